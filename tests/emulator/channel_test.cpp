// How a channel waits for a reader that is slow, or has stopped reading.
#include "emulator/imu/channel.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <array>
#include <functional>
#include <thread>

#include "emulator/config/load_config.hpp"
#include "protocols/protocol.hpp"
#include "tests/emulator/run/run_test.hpp"
#include "transports/file_descriptor.hpp"
#include "transports/host_clock.hpp"

namespace imud {
namespace {

using namespace std::chrono_literals;

// A device with one frame of a kilobyte for each sample.
class Kilobytes final : public Device {
 public:
  void sample(const Sample&, FrameBuffer& out) noexcept override {
    out.room(1024);
    out.push(1024);
  }
};

constexpr Protocol kilobytes = {
    .name = "kilobytes",
    .summary = "",
    .link = Link::bytes,
    .document = "",
    .settings = {},
    .make = [](const Settings&) -> std::unique_ptr<Device> { return std::make_unique<Kilobytes>(); },
    .make_decoder = [](const Settings&) -> std::unique_ptr<Decoder> { return nullptr; },
};

// A port that holds, without limit, all frames that a pipe does not accept immediately, or that are not due.
class PipePort final : public Port {
 public:
  explicit PipePort(int pipe) : pipe_(pipe) {}
  void send(std::span<const Frame> frames) noexcept override {
    waiting_ += frames.size();
    write_waiting();
  }
  void flush() noexcept override {
    ++flushes;
    if (on_flush) on_flush();
    write_waiting();
  }
  std::optional<Received> receive() noexcept override { return std::nullopt; }
  int descriptor() const noexcept override { return pipe_; }
  std::optional<HostTime> next_flush() const noexcept override {
    return is_paced ? std::optional(host_now() + 5s) : std::nullopt;
  }

  bool is_paced = false;  // no frame is due
  std::uint64_t flushes = 0;
  std::function<void()> on_flush;

 private:
  void write_waiting() noexcept {
    const std::array<char, 1024> frame{};  // a pipe accepts it whole or not at all
    for (; !is_paced && waiting_ > 0 && ::write(pipe_, frame.data(), frame.size()) > 0; --waiting_) ++counters_.sent;
  }
  const int pipe_;
  std::uint64_t waiting_ = 0;
};

class ChannelTest : public RunTest {
 protected:
  ChannelTest() {
    std::array<int, 2> ends{};
    if (::pipe2(ends.data(), O_NONBLOCK | O_CLOEXEC) != 0) throw std::runtime_error("no pipe");
    reader_.reset(ends[0]);
    writer_.reset(ends[1]);
    ImuConfig imu =
        load_config(config("lockstep", "udp:127.0.0.1:9810", "native", 100, "native", "file:out")).imus[0];
    imu.protocol = &kilobytes;
    channel_.emplace(imu, 0, 1, [this](const PortUse&) {
      auto port = std::make_unique<PipePort>(writer_.get());
      port_ = port.get();
      return port;
    });
    channel_->sensor.clock().start_samples();
  }
  // More than the pipe accepts.
  void fill() {
    for (int i = 0; i < 100; ++i, ++handed_) {
      channel_->sensor.sense_at_rest(Nanoseconds{}, handed_);
      channel_->prepare(std::nullopt, false);
      channel_->encode(channel_->prepared);
      channel_->transmit();
    }
    ASSERT_LT(port_->counters().sent, handed_) << "the pipe holds everything: the test proves nothing";
  }
  // Reads everything in the pipe.
  void read_all() {
    std::array<char, 4096> buffer;
    while (::read(reader_.get(), buffer.data(), buffer.size()) > 0) {
    }
  }
  // Waits as lockstep does, for a minute at most.
  void wait_until_sent() {
    std::atomic<bool> stop = false, done = false;
    std::thread timeout([&] { stop = !eventually([&] { return done.load(); }); });
    channel_->wait_until_sent(stop);
    EXPECT_FALSE(stop) << "it waits for ever";
    done = true;
    timeout.join();
  }

  FileDescriptor reader_, writer_;
  PipePort* port_ = nullptr;
  std::optional<Channel> channel_;
  std::uint64_t handed_ = 0;
};

TEST_F(ChannelTest, AReaderThatReadsSlowlyIsWaitedFor) {
  fill();
  port_->on_flush = [this, n = 0]() mutable {
    std::array<char, 4096> buffer;
    if (++n % 3 == 0) {
      EXPECT_GT(::read(reader_.get(), buffer.data(), buffer.size()), 0);
    }
  };
  wait_until_sent();
  EXPECT_EQ(port_->counters().sent, handed_);
}

TEST_F(ChannelTest, AReaderThatDoesNotReadIsNotWaitedForLong) {
  fill();
  const HostTime begin = host_now();
  wait_until_sent();
  EXPECT_GE(host_now() - begin, 2s);
  EXPECT_LT(port_->counters().sent, handed_);
  EXPECT_GT(port_->flushes, 10U);

  // From now on the channel does not wait at all.
  port_->flushes = 0;
  for (int i = 0; i < 10; ++i) wait_until_sent();
  EXPECT_EQ(port_->flushes, 10U);
}

TEST_F(ChannelTest, AReaderThatReadsAgainIsWaitedForAgain) {
  fill();
  wait_until_sent();
  ASSERT_LT(port_->counters().sent, handed_);
  for (int i = 0; i < 10 && port_->counters().sent < handed_; ++i) {
    read_all();
    channel_->flush();
  }
  read_all();
  wait_until_sent();
  ASSERT_EQ(port_->counters().sent, handed_);

  fill();
  port_->on_flush = [this, n = 0]() mutable {
    if (++n > 2) read_all();  // after the channel has waited
  };
  wait_until_sent();
  EXPECT_EQ(port_->counters().sent, handed_);
}

TEST_F(ChannelTest, AStopEndsTheWaiting) {
  fill();
  std::atomic<bool> stop = false;
  port_->on_flush = [&, n = 0]() mutable { stop = ++n == 5; };
  channel_->wait_until_sent(stop);
  EXPECT_EQ(port_->flushes, 5U);
}

TEST_F(ChannelTest, AStopEndsTheWaitingForAFrameThatIsNotDue) {
  port_->is_paced = true;
  channel_->sensor.sense_at_rest(Nanoseconds{}, 0);
  channel_->prepare(std::nullopt, false);
  channel_->encode(channel_->prepared);
  channel_->transmit();
  std::atomic<bool> stop = false;
  port_->on_flush = [&, n = 0]() mutable { stop = ++n == 5; };
  channel_->wait_until_sent(stop);
  EXPECT_EQ(port_->flushes, 5U);
}

}  // namespace
}  // namespace imud
