#include <fmt/format.h>
#include <gtest/gtest.h>
#include <sys/ioctl.h>

#include <fstream>
#include <thread>

#include "tests/transports/port_error.hpp"
#include "tests/transports/scratch_folder.hpp"
#include "tests/transports/terminal.hpp"
#include "transports/uart/termios2.hpp"

namespace imud {
namespace {

using namespace std::chrono_literals;

class Serial : public ::testing::Test {
 protected:
  std::unique_ptr<Port> open(const std::string& options = "") const {
    return open_port("serial:" + path + options, Role::device);
  }
  // Sends single frames, at about 1 kHz, until the port has its device again.
  void send_until_back(Port& port) {
    for (int i = 0; i < 30'000 && port.state() == PortState::lost; ++i) {
      port.send(frames.next(1));
      std::this_thread::sleep_for(1ms);
    }
    ASSERT_EQ(port.state(), PortState::ready);
  }
  // The flag itself, because root may open an exclusive line.
  static bool is_exclusive(int fd) {
    int flag = 0;
    EXPECT_EQ(::ioctl(fd, TIOCGEXCL, &flag), 0);
    return flag != 0;
  }
  static std::uint64_t decided(const Port& port) { return port.counters().sent + port.counters().dropped; }
  static auto open_descriptors() { return std::distance(std::filesystem::directory_iterator("/proc/self/fd"), {}); }

  ScratchFolder folder;
  const std::string path = folder / "ttyUSB0";
  NumberedFrames frames;
  NumberedReader reader;
};

TEST_F(Serial, DefaultIs115200BaudEightBitsNoParityOneStopBit) {
  SerialDevice device(path);
  const auto port = open();
  const termios line = device.line();
  EXPECT_EQ(line_speed(device.fd()), 115200U);
  EXPECT_EQ(line.c_cflag & CBAUD, tcflag_t{B115200});
  EXPECT_EQ(line.c_cflag & CSIZE, tcflag_t{CS8});
  EXPECT_EQ(line.c_cflag & (PARENB | CSTOPB | CRTSCTS), 0U);
  EXPECT_NE(line.c_cflag & CLOCAL, 0U);
  EXPECT_EQ(line.c_iflag & (ICRNL | INLCR | IGNCR | IXON | IXOFF | ISTRIP), 0U);
  EXPECT_EQ(line.c_lflag & (ICANON | ECHO | ISIG), 0U);
  EXPECT_EQ(line.c_oflag & OPOST, 0U);
}

TEST_F(Serial, AnySpeedIsSetAndReadBack) {
  for (const unsigned baud : {50U, 9600U, 374400U, 460800U, 921600U, 1843200U, 3999999U, 4000000U}) {
    SerialDevice device(path);
    const auto port = open(fmt::format("?baud={}", baud));
    EXPECT_EQ(line_speed(device.fd()), baud);
    device.unplug();
  }
}

TEST_F(Serial, CharacterFormat) {
  // A pty keeps only these three bits of the format, and forces eight bits without parity.
  SerialDevice device(path);
  auto port = open("?stop=2&flow=rtscts&parity=odd&baud=1843200");
  EXPECT_EQ(device.line().c_cflag & (CSTOPB | CRTSCTS | PARODD), tcflag_t{CSTOPB | CRTSCTS | PARODD});
  port.reset();
  port = open("?stop=1&flow=none&parity=even");
  EXPECT_EQ(device.line().c_cflag & (CSTOPB | CRTSCTS | PARODD), 0U);
  EXPECT_NE(device.line().c_iflag & INPCK, 0U);
  port.reset();
  port = open("?bits=7");
  EXPECT_NE(device.line().c_iflag & ISTRIP, 0U);
}

TEST_F(Serial, TheDevicesUartTakesThePlaceOfTheOptions) {
  SerialDevice device(path);
  PortSettings settings = Role::device;
  settings.uart = {374'400, Parity::odd, 2};
  const auto port = open_port("serial:" + path + "?flow=rtscts", settings);
  EXPECT_EQ(line_speed(device.fd()), 374'400U);
  EXPECT_EQ(device.line().c_cflag & (CSTOPB | CRTSCTS | PARODD), tcflag_t{CSTOPB | CRTSCTS | PARODD});
}

TEST_F(Serial, ADeviceThatChangesItsLineIsFollowed) {
  SerialDevice device(path);
  const auto port = open();
  const auto format = [&] { return device.line().c_cflag & (CSTOPB | PARODD); };
  port->set_line({460'800, Parity::odd, 1});
  EXPECT_EQ(line_speed(device.fd()), 460'800U);
  EXPECT_EQ(format(), tcflag_t{PARODD});
  port->set_line({115'200, Parity::even, 2});
  EXPECT_EQ(line_speed(device.fd()), 115'200U);
  EXPECT_EQ(format(), tcflag_t{CSTOPB});
  port->set_line({115'200, Parity::none, 1});
  EXPECT_EQ(format(), 0U);
}

// A second program that opened the line would read bytes unnoticed.
TEST_F(Serial, TheLineIsHeldExclusively) {
  SerialDevice device(path);
  auto port = open();
  EXPECT_TRUE(is_exclusive(port->descriptor()));
  port.reset();
  const FileDescriptor next = open_terminal(path);
  EXPECT_FALSE(is_exclusive(next.get()));
}

TEST_F(Serial, EveryByteValuePassesBothWays) {
  SerialDevice device(path);
  const auto port = open("?baud=921600");
  std::vector<std::byte> all(256);
  for (std::size_t i = 0; i < all.size(); ++i) all[i] = static_cast<std::byte>(i);
  port->send({{Frame{all}}});
  EXPECT_EQ(read_some(device.fd()), all);
  EXPECT_EQ(port->receive(), std::nullopt);
  ASSERT_EQ(::write(device.fd(), all.data(), all.size()), 256);
  pollfd ready{port->descriptor(), POLLIN, 0};
  ASSERT_EQ(::poll(&ready, 1, 5000), 1);
  const auto received = port->receive();
  ASSERT_TRUE(received.has_value());
  EXPECT_TRUE(std::equal(all.begin(), all.end(), received->frame.bytes.begin(), received->frame.bytes.end()));
  EXPECT_EQ(port->state(), PortState::ready);
}

TEST_F(Serial, PeerThatStopsTearsNoFrame) {
  SerialDevice device(path);
  const auto port = open();
  int torn = 0;
  for (int i = 0; i < 1500; ++i) {
    port->send(frames.next(3));
    ASSERT_EQ(port->wants_output(), decided(*port) < frames.made());
    torn += port->wants_output() ? 1 : 0;
    if (i > 1000) reader.feed(read_some(device.fd(), 300, 0));
  }
  EXPECT_GT(torn, 0) << "a frame taken in part waits for room";
  EXPECT_GT(port->counters().dropped, 0U);
  EXPECT_EQ(port->state(), PortState::ready);
  for (int i = 0; i < 3; ++i) {
    drain(device.fd(), reader);
    port->flush();
  }
  EXPECT_FALSE(port->wants_output());
  EXPECT_EQ(reader.broken + reader.unfinished(), 0U);
  EXPECT_EQ(reader.numbers.size(), port->counters().sent);
  EXPECT_EQ(decided(*port), frames.made());
}

TEST_F(Serial, UnpluggedAndBack) {
  SerialDevice device(path);
  const auto before = open_descriptors();
  const auto port = open("?baud=374400&stop=2");
  for (std::uint64_t time = 1; time <= 3; ++time) {
    // The line is full, so that the loss tears a frame.
    for (int i = 0; i < 1000; ++i) port->send(frames.next(1));
    device.unplug();
    const std::uint64_t sent = port->counters().sent;
    for (int i = 0; i < 100; ++i) port->send(frames.next(2));
    EXPECT_EQ(port->state(), PortState::lost);
    EXPECT_EQ(port->counters().lost_count, time);
    EXPECT_EQ(port->counters().sent, sent);
    EXPECT_EQ(decided(*port), frames.made());
    EXPECT_EQ(port->descriptor(), -1);
    EXPECT_EQ(open_descriptors(), before - 1) << "a device held open comes back under another name";

    device.plug_in();
    send_until_back(*port);
    NumberedReader fresh;
    for (int i = 0; i < 20; ++i) port->send(frames.next(1));
    drain(device.fd(), fresh);
    EXPECT_EQ(fresh.broken + fresh.unfinished(), 0U);
    EXPECT_EQ(fresh.numbers.size(), 21U);
    EXPECT_EQ(fresh.numbers.back(), frames.made() - 1);
    EXPECT_EQ(line_speed(device.fd()), 374400U);
    EXPECT_NE(device.line().c_cflag & CSTOPB, 0U);
    EXPECT_TRUE(is_exclusive(port->descriptor()));
  }
  EXPECT_EQ(decided(*port), frames.made());
}

TEST_F(Serial, ReceivingNoticesTheLossAndTheReturn) {
  SerialDevice device(path);
  const auto port = open();
  device.unplug();
  EXPECT_EQ(port->receive(), std::nullopt);
  EXPECT_EQ(port->state(), PortState::lost);
  EXPECT_EQ(port->counters().lost_count, 1U);
  EXPECT_FALSE(port->at_end());
  device.plug_in();
  for (int i = 0; i < 3000 && port->state() == PortState::lost; ++i) {
    EXPECT_EQ(port->receive(), std::nullopt);
    std::this_thread::sleep_for(10ms);
  }
  ASSERT_EQ(port->state(), PortState::ready);
  ASSERT_EQ(::write(device.fd(), "x", 1), 1);
  pollfd ready{port->descriptor(), POLLIN, 0};
  ASSERT_EQ(::poll(&ready, 1, 5000), 1);
  EXPECT_TRUE(port->receive().has_value());
}

TEST_F(Serial, ClosedWhileUnplugged) {
  SerialDevice device(path);
  const auto before = open_descriptors();
  for (const char* options : {"", "?flow=rtscts"}) {
    auto port = open(options);
    device.unplug();
    port->send(frames.next(1));
    port.reset();
    device.plug_in();
  }
  EXPECT_EQ(open_descriptors(), before);
}

TEST_F(Serial, NamesTheCauseIfItCannotBeOpened) {
  const auto before = open_descriptors();
  EXPECT_EQ(error_of("serial:" + path), "serial:" + path + ": cannot open it: No such file or directory");
  std::ofstream(path) << "x";
  EXPECT_TRUE(mentions(error_of("serial:" + path), "is not a serial line"));
  EXPECT_TRUE(mentions(error_of("serial:/dev/null"), "is not a serial line"));
  EXPECT_TRUE(mentions(error_of("serial:" + path + "?baud=49"), "from 50 to 4000000"));
  EXPECT_TRUE(mentions(error_of("serial:" + path + "?baud=4000001"), "from 50 to 4000000"));
  EXPECT_TRUE(mentions(error_of("serial:" + path + "?parity=mark"), "none even odd"));
  EXPECT_TRUE(mentions(error_of("serial:" + path + "?stop=3"), "from 1 to 2"));
  EXPECT_TRUE(mentions(error_of("serial:" + path + "?bits=9"), "from 7 to 8"));
  EXPECT_TRUE(mentions(error_of("serial:" + path + "?flow=xon"), "none rtscts"));
  EXPECT_EQ(open_descriptors(), before);
}

}  // namespace
}  // namespace imud
