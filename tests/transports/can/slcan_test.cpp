// A CAN adapter on a serial line, whose other end the test holds: a pty.
#include <gtest/gtest.h>

#include <random>
#include <string>
#include <thread>

#include "tests/support/allocations.hpp"
#include "tests/transports/port_error.hpp"
#include "tests/transports/scratch_folder.hpp"
#include "tests/transports/terminal.hpp"
#include "transports/can/slcan_text.hpp"
#include "transports/host_clock.hpp"
#include "transports/uart/termios2.hpp"

namespace imud {
namespace {

using namespace std::chrono_literals;

// The frames of one sample, with the data 0x11, 0x22, ...
class LineFrames {
 public:
  LineFrames& add(const CanHeader& header, std::size_t size) {
    const auto room = buffer_.room(size);
    for (std::size_t i = 0; i < size; ++i) room[i] = static_cast<std::byte>(0x11 * (i + 1));
    buffer_.push(size, header);
    return *this;
  }
  operator std::span<const Frame>() const { return buffer_.frames(); }

 private:
  FrameBuffer buffer_;
};

class Slcan : public ::testing::Test {
 protected:
  std::unique_ptr<Port> open(const std::string& options = "", Role role = Role::device) const {
    return open_port("slcan:" + path + options, role);
  }
  // Returns what the adapter has received; reads until nothing arrives for 100 ms.
  static std::string received_by(const SerialDevice& device) {
    std::string text;
    for (auto bytes = read_some(device.fd()); !bytes.empty(); bytes = read_some(device.fd()))
      text.append(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    return text;
  }
  static void send(const SerialDevice& device, std::string_view text) {
    ASSERT_EQ(::write(device.fd(), text.data(), text.size()), static_cast<ssize_t>(text.size()));
  }
  static std::optional<Port::Received> receive_next(Port& port) {
    for (int i = 0; i < 3000; ++i) {
      if (auto received = port.receive()) return received;
      std::this_thread::sleep_for(10ms);
    }
    return std::nullopt;
  }

  ScratchFolder folder;
  const std::string path = folder / "ttyACM0";
};

TEST_F(Slcan, TheChannelIsOpenedAndClosed) {
  SerialDevice device(path);
  {
    const auto port = open("?bitrate=500000&baud=230400&data_bitrate=2000000");
    EXPECT_EQ(received_by(device), "\r\r\rC\rS6\rY2\rO\r");
    EXPECT_EQ(line_speed(device.fd()), 230'400U);
    EXPECT_EQ(port->state(), PortState::ready);
  }
  EXPECT_EQ(received_by(device), "C\r");
  const auto port = open();
  EXPECT_EQ(received_by(device), "\r\r\rC\rO\r") << "the adapter keeps its bit rate";
  EXPECT_EQ(port->counters().sent, 0U);
  const std::pair<const char*, const char*> rates[] = {{"10000", "S0"},  {"20000", "S1"},  {"50000", "S2"},
                                                       {"100000", "S3"}, {"125000", "S4"}, {"250000", "S5"},
                                                       {"800000", "S7"}, {"1000000", "S8"}};
  for (const auto& [rate, command] : rates) {
    SerialDevice other(folder / rate);
    const auto opened = open_port(std::string("slcan:") + (folder / rate) + "?bitrate=" + rate, Role::device);
    EXPECT_EQ(received_by(other), std::string("\r\r\rC\r") + command + "\rO\r");
  }
}

TEST_F(Slcan, FramesAreTheTextOfLawicelAndOfCanable) {
  SerialDevice device(path);
  const auto port = open("?data_bitrate=5000000");
  received_by(device);
  port->send(LineFrames()
                 .add({.id = 0x123}, 8)
                 .add({.id = 0x18FF1234, .extended = true}, 1)
                 .add({.id = 7, .remote = true}, 5)
                 .add({.id = 0x18FF1234, .extended = true, .remote = true}, 0)
                 .add({.id = 0x7FF, .fd = true}, 9)
                 .add({.id = 0x123, .extended = true, .fd = true, .bit_rate_switch = true}, 2)
                 .add({.id = 0x800}, 0));
  EXPECT_EQ(
      received_by(device),
      "t12381122334455667788\rT18FF1234111\rr0075\rR18FF12340\rd7FF9112233445566778899000000\rB0000012321122\r");
  EXPECT_EQ(port->counters().sent, 6U);
  EXPECT_EQ(port->counters().dropped, 1U) << "an identifier of more than 11 bits";
  port->reply(LineFrames().add({.id = 1}, 0).add({.id = 2}, 0));
  EXPECT_EQ(port->counters().replies, 2U);

  const auto classic = open_port("slcan:" + path, Role::device);
  classic->send(LineFrames().add({.fd = true}, 1));
  EXPECT_EQ(classic->counters().dropped, 1U) << "an adapter without a data bit rate";
}

TEST_F(Slcan, FramesOfTheAdapterAreReceivedInPieces) {
  SerialDevice device(path);
  const auto port = open();
  send(device, "\r\az\rZ\rV1013\rN1234\rF08\rt12381122334455667788\rt1231");
  const auto first = receive_next(*port);
  ASSERT_TRUE(first);
  EXPECT_EQ(first->frame.can, (CanHeader{.id = 0x123}));
  EXPECT_EQ(first->frame.bytes.size(), 8U);
  EXPECT_EQ(first->frame.bytes[7], std::byte{0x88});
  EXPECT_LT(host_now() - first->time, 10s);
  EXPECT_FALSE(port->receive());
  // A time stamp of LAWICEL in ms, one in us, an FD frame, a remote frame, a line feed after the carriage return.
  send(device, "114BE0\rT18FF123411100ABCDEF\r\nb12391122334455667788990A0B0C\rR000000018\r");
  ASSERT_EQ(receive_next(*port)->frame.bytes.size(), 1U);
  EXPECT_EQ(receive_next(*port)->frame.can, (CanHeader{.id = 0x18FF1234, .extended = true}));
  const auto fd = receive_next(*port);
  ASSERT_TRUE(fd);
  EXPECT_EQ(fd->frame.can, (CanHeader{.id = 0x123, .fd = true, .bit_rate_switch = true}));
  EXPECT_EQ(fd->frame.bytes.size(), 12U);
  const auto remote = receive_next(*port);
  ASSERT_TRUE(remote);
  EXPECT_EQ(remote->frame.can, (CanHeader{.id = 1, .extended = true, .remote = true}));
  EXPECT_EQ(remote->frame.bytes.size(), 8U);
  EXPECT_EQ(port->counters().received, 5U);
  EXPECT_EQ(port->counters().not_ours + port->counters().refused, 0U);
}

TEST_F(Slcan, OnlyFramesThatPassAFilterAreReceived) {
  SerialDevice device(path);
  const auto port = open();
  const CanFilter filters[] = {{.id = 0x100, .mask = 0x700},
                               {.id = 5, .extended = true, .data = false, .remote = true}};
  port->set_filters(filters);
  send(device, "t2000\rt17F0\rr1000\rT000000050\rR000000050\rt1000\r");
  EXPECT_EQ(receive_next(*port)->frame.can.id, 0x17FU);
  EXPECT_EQ(receive_next(*port)->frame.can, (CanHeader{.id = 5, .extended = true, .remote = true}));
  EXPECT_EQ(receive_next(*port)->frame.can.id, 0x100U);
  EXPECT_EQ(port->counters().received, 3U);
}

TEST_F(Slcan, ARefusalOfAFrameIsCounted) {
  SerialDevice device(path);
  const auto port = open();
  send(device, "\a\a");
  std::this_thread::sleep_for(50ms);
  EXPECT_FALSE(port->receive());
  EXPECT_EQ(port->counters().refused, 0U) << "the channel could not be closed, because it was not open";
  port->send(LineFrames().add({.id = 1}, 0));
  send(device, "\a");
  for (int i = 0; i < 3000 && port->counters().refused == 0; ++i) {
    EXPECT_FALSE(port->receive());
    std::this_thread::sleep_for(10ms);
  }
  EXPECT_EQ(port->counters().refused, 1U);
}

// The adapter reads nothing until its line is full; then it reads all.
TEST_F(Slcan, ASampleLeavesWholeOrNotAtAll) {
  SerialDevice device(path);
  const auto port = open();
  constexpr std::uint64_t samples = 2000;
  std::string text;
  for (std::uint32_t i = 0; i < samples; ++i) {
    LineFrames sample;
    for (std::uint32_t k = 0; k < 7; ++k) sample.add({.id = i % 0x100 * 8 + k}, 8);
    port->send(sample);
    if (i == samples / 2) text += received_by(device);
  }
  EXPECT_GT(port->counters().dropped, 0U);
  EXPECT_EQ(port->counters().dropped % 7, 0U);
  text += received_by(device);
  EXPECT_TRUE(port->is_drained());
  text += received_by(device);
  EXPECT_EQ(port->counters().sent % 7, 0U);
  EXPECT_EQ(port->counters().sent + port->counters().dropped, 7 * samples);
  SlcanReader reader;
  std::uint64_t frames = 0;
  for (const char byte : text.substr(text.find("O\r") + 2)) {
    const auto result = reader.feed(byte);
    EXPECT_NE(result, SlcanReader::Result::malformed);
    if (result != SlcanReader::Result::frame) continue;
    EXPECT_EQ(reader.frame().can.id % 8, frames % 7) << "of a sample no frame is missing";
    ++frames;
  }
  EXPECT_EQ(frames, port->counters().sent);
}

TEST_F(Slcan, AnAdapterThatComesBackIsOpenedAgain) {
  SerialDevice device(path);
  const auto port = open("?bitrate=250000");
  port->send(LineFrames().add({.id = 1}, 0));
  device.unplug();
  const std::uint64_t before = allocations();
  for (int i = 0; i < 3; ++i) port->send(LineFrames().add({.id = 2}, 0));
  EXPECT_FALSE(port->receive());
  EXPECT_EQ(port->state(), PortState::lost);
  EXPECT_LT(port->descriptor(), 0);
  EXPECT_EQ(port->counters().lost_count, 1U);
  EXPECT_EQ(port->counters().sent + port->counters().dropped, 4U);
  EXPECT_EQ(allocations(), before);
  for (const bool receives : {true, false}) {
    device.plug_in();
    for (int i = 0; i < 1000 && port->state() == PortState::lost; ++i) {
      if (receives)
        port->receive();
      else
        port->send(LineFrames().add({.id = 3}, 0));
      std::this_thread::sleep_for(10ms);
    }
    ASSERT_EQ(port->state(), PortState::ready);
    port->send(LineFrames().add({.id = 4}, 0));
    EXPECT_EQ(received_by(device), std::string("\r\r\rC\rS5\rO\r") + (receives ? "" : "t0030\r") + "t0040\r");
    send(device, "t0050\r");
    EXPECT_EQ(receive_next(*port)->frame.can.id, 5U);
    device.unplug();
    port->receive();
    port->receive();
  }
}

TEST_F(Slcan, NoBytesAreHarmful) {
  std::mt19937 random(1);
  const std::string alphabet = "tTrRdDbBzZ0123456789ABCDEFabcdef\r\r\r\a\n ";
  SlcanReader reader;
  std::uint64_t frames = 0, malformed = 0;
  for (int i = 0; i < 2'000'000; ++i) {
    const char byte = random() % 16 == 0 ? static_cast<char>(random()) : alphabet[random() % alphabet.size()];
    const auto result = reader.feed(byte);
    malformed += result == SlcanReader::Result::malformed ? 1 : 0;
    if (result != SlcanReader::Result::frame) continue;
    ++frames;
    EXPECT_LE(reader.frame().bytes.size(), reader.frame().can.fd ? 64U : 8U);
  }
  EXPECT_GT(malformed, 10'000U);
  EXPECT_GT(frames, 10U);
  for (const char c : std::string(100'000, 'T')) reader.feed(c);
  EXPECT_EQ(reader.feed('\r'), SlcanReader::Result::malformed);
  for (const char* line :
       {"t", "t12", "t123", "t1232FF", "t8000", "tXYZ0", "t1231GG", "T200000000", "t1230123", "x"}) {
    for (const char* c = line; *c != 0; ++c) reader.feed(*c);
    EXPECT_EQ(reader.feed('\r'), SlcanReader::Result::malformed) << line;
  }
}

TEST_F(Slcan, ErrorsNameWhatWouldBeRight) {
  EXPECT_TRUE(mentions(error_of("slcan:" + path), "slcan:" + path + ": cannot open it: No such file or directory"));
  EXPECT_TRUE(mentions(error_of("slcan:" + path + "?bitrate=300000"), "10000 20000 50000"));
  EXPECT_TRUE(mentions(error_of("slcan:" + path + "?data_bitrate=8000000"), "data_bitrate=8000000"));
  EXPECT_TRUE(mentions(error_of("slcan:/dev/null"), "is not a serial line"));
}

}  // namespace
}  // namespace imud
