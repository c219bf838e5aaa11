// imud replay --fast: the frames that have arrived are those that the summary counts as sent, or the exit code is not
// 0.
#include <fcntl.h>
#include <sys/ioctl.h>
#include <sys/stat.h>
#include <termios.h>

#include "protocols/protocol.hpp"
#include "tests/emulator/run/live_test.hpp"

namespace imud {
namespace {

class ArrivedTest : public LiveTest {
 protected:
  void SetUp() override {
    ASSERT_EQ(
        run_program("imu-truth", {"spiral", "--csv", path("truth.csv"), "--rate", "100", "--for", "3"}).exit_code, 0);
  }
  // Replays to the port while `receive` is called until the run has ended and nothing more arrives; it appends to its
  // argument, and returns false if nothing was there. Expects all frames of 3 s.
  template <class Receive>
  void expect_all(const std::string& port, double rate_hz, Receive receive) {
    const std::string c = config("fast", "file:" + path("truth.csv"), "csv", rate_hz, "native", port);
    std::string bytes;
    Program imud("imud");
    imud.start({"replay", c, path("truth.csv"), "--fast", "--summary", path("summary.json")});
    while (imud.is_running())
      if (!receive(bytes)) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    EXPECT_EQ(imud.wait(), 0) << imud.errors();
    while (receive(bytes)) {
    }
    const Protocol& native = *find_protocol("native");
    const auto decoder = native.make_decoder(Settings(native.settings));
    if (bytes.empty()) bytes = imud.output();
    decoder->feed({std::as_bytes(std::span(bytes))}, count_);
    decoder->finish(count_);
    EXPECT_EQ(count_.seen, static_cast<std::uint64_t>(3 * rate_hz) + 1);
    EXPECT_EQ(summary()["imus"][0]["frames"], count_.seen);
    EXPECT_EQ(decoder->errors().checksum + decoder->errors().malformed + decoder->errors().skipped_bytes, 0U);
  }
  static auto from(int descriptor) {
    return [descriptor](std::string& bytes) {
      std::array<char, 20'000> buffer;
      const ssize_t size = ::read(descriptor, buffer.data(), buffer.size());
      if (size > 0) bytes.append(buffer.data(), static_cast<std::size_t>(size));
      return size > 0;
    };
  }

  struct Count final : MeasurementSink {
    void on_measurement(const Measurement& measurement) override { EXPECT_EQ(measurement.sample.counter, seen++); }
    std::uint64_t seen = 0;
  } count_;
};

TEST_F(ArrivedTest, File) {
  bool read = false;
  expect_all("file:" + path("out"), 1000, [&](std::string& bytes) {
    if (read || !std::filesystem::exists(path("out"))) return false;  // it appears whole
    bytes = read_file(path("out"));
    return read = true;
  });
}

TEST_F(ArrivedTest, StandardOutput) {
  expect_all("file:-", 1000, [](std::string&) { return false; });
}

TEST_F(ArrivedTest, Fifo) {
  ASSERT_EQ(::mkfifo(path("fifo").c_str(), 0600), 0);
  const FileDescriptor reader(::open(path("fifo").c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC));
  expect_all("file:" + path("fifo"), 1000, from(reader.get()));
}

TEST_F(ArrivedTest, Pty) {
  Program keeper("imud");
  keeper.start({"pty", path("imu")});
  ASSERT_TRUE(keeper.wait_for_output("is held"));
  const FileDescriptor reader(::open(path("imu").c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC));
  termios raw{};
  ASSERT_EQ(::tcgetattr(reader.get(), &raw), 0);
  ::cfmakeraw(&raw);
  ::tcsetattr(reader.get(), TCSANOW, &raw);
  expect_all("pty:" + path("imu"), 1000, from(reader.get()));
}

// The receiver's buffer has room for all datagrams; UDP reports no loss.
TEST_F(ArrivedTest, Udp) {
  const FileDescriptor receiver(::socket(AF_INET, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
  const int room = 200'000;  // Linux doubles it; a datagram occupies less than 1 kB
  ::setsockopt(receiver.get(), SOL_SOCKET, SO_RCVBUF, &room, sizeof room);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof address;
  ASSERT_EQ(::bind(receiver.get(), reinterpret_cast<const sockaddr*>(&address), size), 0);
  ASSERT_EQ(::getsockname(receiver.get(), reinterpret_cast<sockaddr*>(&address), &size), 0);
  expect_all(fmt::format("udp:127.0.0.1:{}", ntohs(address.sin_port)), 100, from(receiver.get()));
}

// A reader that leaves makes the run incomplete.
TEST_F(ArrivedTest, WhatHasNotArrivedIsInTheExitCode) {
  ASSERT_EQ(::mkfifo(path("fifo").c_str(), 0600), 0);
  FileDescriptor reader(::open(path("fifo").c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC));
  const std::string c = config("fast", "file:" + path("truth.csv"), "csv", 1000, "native", "file:" + path("fifo"));
  Program imud("imud");
  imud.start({"replay", c, path("truth.csv"), "--fast", "--summary", path("summary.json")});
  std::string bytes;
  ASSERT_TRUE(eventually([&] { return from(reader.get())(bytes); }));
  reader.reset();
  EXPECT_EQ(imud.wait(), 3) << imud.errors();
  EXPECT_GT(summary()["imus"][0]["dropped"], 0);
}

}  // namespace
}  // namespace imud
