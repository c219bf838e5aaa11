// A pty as a serial line: the speeds of both ends, and the duration of characters.
#include <gtest/gtest.h>

#include "tests/transports/port_error.hpp"
#include "tests/transports/scratch_folder.hpp"
#include "tests/transports/terminal.hpp"
#include "transports/host_clock.hpp"
#include "transports/uart/termios2.hpp"
#include "transports/uart/uart_wire.hpp"

namespace imud {
namespace {

using Bytes = std::vector<std::byte>;

PortSettings paced(const UartSettings& uart) {
  PortSettings settings = Role::device;
  settings.uart = uart;
  settings.paced = true;
  return settings;
}

class PtyLine : public ::testing::Test {
 protected:
  std::unique_ptr<Port> device(const std::string& options) const {
    return open_port("pty:" + link + options, Role::device);
  }
  std::unique_ptr<Port> paced_device(const UartSettings& uart) const { return open_port("pty:" + link, paced(uart)); }

  // Returns what is received of frames sent back to back before an idle line.
  static Bytes garbled(const UartSettings& sender, unsigned receiver, std::span<const Frame> sent) {
    UartWire wire;
    wire.set(sender, receiver);
    Bytes all(100'000);
    std::size_t count = 0;
    for (const Frame& frame : sent) count += wire.carry(frame.bytes, std::span(all).subspan(count));
    if (const auto last = wire.idle()) all[count++] = *last;
    all.resize(count);
    return all;
  }
  static Bytes read_all(int fd) {
    Bytes all;
    for (auto some = read_some(fd); !some.empty(); some = read_some(fd))
      all.insert(all.end(), some.begin(), some.end());
    return all;
  }
  static Bytes together(std::span<const Frame> some) {
    Bytes all;
    for (const Frame& frame : some) all.insert(all.end(), frame.bytes.begin(), frame.bytes.end());
    return all;
  }
  static Bytes received(Port& port, int client, const Bytes& sent) {
    EXPECT_EQ(::write(client, sent.data(), sent.size()), static_cast<ssize_t>(sent.size()));
    pollfd ready{port.descriptor(), POLLIN, 0};
    EXPECT_EQ(::poll(&ready, 1, 5000), 1);
    const auto received = port.receive();
    if (!received) return {};
    return {received->frame.bytes.begin(), received->frame.bytes.end()};
  }

  ScratchFolder folder;
  const std::string link = folder / "imu1";
  NumberedFrames frames;
  NumberedReader reader;
};

TEST_F(PtyLine, AClientAtAnotherSpeedReceivesAndSendsGarbage) {
  const auto port = device("?baud=115200");
  const FileDescriptor client = open_terminal(link);
  const Bytes word = {std::byte{'$'}, std::byte{'V'}, std::byte{'N'}, std::byte{'\n'}};
  // First at the speed of the device; then at another speed; then at a speed 2 % off, which is received correctly.
  port->send(frames.next(3));
  EXPECT_EQ(port->state(), PortState::ready);
  drain(client.get(), reader);
  EXPECT_EQ(reader.numbers.size(), 3U);
  EXPECT_EQ(received(*port, client.get(), word), word);

  ASSERT_TRUE(set_line_speed(client.get(), 9600));
  const auto some = frames.next(5);
  port->send(some);
  EXPECT_EQ(port->state(), PortState::wrong_speed);
  EXPECT_EQ(port->speeds().line, 115'200U);
  EXPECT_EQ(port->speeds().client, 9600U);
  const Bytes seen = read_all(client.get());
  EXPECT_EQ(seen, garbled({115'200}, 9600, some));
  EXPECT_FALSE(seen.empty());
  EXPECT_EQ(received(*port, client.get(), word), garbled({9600}, 115'200, {{Frame{word}}}));

  ASSERT_TRUE(set_line_speed(client.get(), 117'000));
  port->send(frames.next(3));
  EXPECT_EQ(port->state(), PortState::ready);
  drain(client.get(), reader);
  EXPECT_EQ(reader.numbers.size(), 6U);
  EXPECT_EQ(reader.broken + reader.unfinished(), 0U);
  EXPECT_EQ(received(*port, client.get(), word), word);
  EXPECT_EQ(port->counters().sent, 11U);
}

TEST_F(PtyLine, ADeviceThatChangesItsSpeedIsFollowed) {
  const auto port = device("?baud=115200");
  const FileDescriptor client = open_terminal(link);
  port->send(frames.next(1));
  port->set_line({921'600, Parity::even, 2});
  drain(client.get(), reader);
  EXPECT_EQ(reader.numbers.size(), 1U) << "sent before";
  const auto some = frames.next(4);
  port->send(some);
  EXPECT_EQ(port->state(), PortState::wrong_speed);
  EXPECT_EQ(read_all(client.get()), garbled({921'600, Parity::even, 2}, 115'200, some));
  EXPECT_EQ(line_speed(client.get()), 115'200U) << "the client's own";
  ASSERT_TRUE(set_line_speed(client.get(), 921'600));
  port->send(frames.next(1));
  drain(client.get(), reader);
  EXPECT_EQ(reader.numbers.size(), 2U);
}

TEST_F(PtyLine, OnlyALineOfKnownSpeedIsChecked) {
  for (const char* options : {"", "?baud=115200&speed=any"}) {
    const auto port = device(options);
    const FileDescriptor client = open_terminal(link);
    for (const unsigned baud : {50U, 9600U, 4'000'000U}) {
      ASSERT_TRUE(set_line_speed(client.get(), baud));
      const auto some = frames.next(2);
      port->send(some);
      EXPECT_EQ(port->state(), PortState::ready);
      EXPECT_EQ(read_some(client.get()), together(some));
    }
  }
}

// A client hangs up by cfsetspeed(B0); it then has no speed that could be wrong.
TEST_F(PtyLine, AClientWithoutSpeedReadsWhatIsSent) {
  const auto port = device("?baud=115200");
  const FileDescriptor client = open_terminal(link);
  termios line{};
  ASSERT_EQ(::tcgetattr(client.get(), &line), 0);
  ASSERT_EQ(::cfsetspeed(&line, B0), 0);
  ASSERT_EQ(::tcsetattr(client.get(), TCSANOW, &line), 0);
  const auto some = frames.next(2);
  port->send(some);
  EXPECT_EQ(port->speeds().client, 0U);
  EXPECT_EQ(port->state(), PortState::ready);
  EXPECT_EQ(read_some(client.get()), together(some));
}

TEST_F(PtyLine, TheDevicesUartTakesThePlaceOfTheOptions) {
  PortSettings settings = Role::device;
  settings.uart = {374'400};
  const auto port = open_port("pty:" + link, settings);
  EXPECT_EQ(line_speed(open_terminal(link).get()), 374'400U);
}

// A reader of garbage that stalls, closes the pty, and opens it again at the right speed.
TEST_F(PtyLine, GarbageIsNeitherBufferedNorTorn) {
  const auto port = device("?baud=115200");
  {
    const FileDescriptor client = open_terminal(link);
    for (int i = 0; i < 300; ++i) port->send(frames.next(3));  // full, with a frame written in part
    const std::uint64_t sent = port->counters().sent;
    ASSERT_TRUE(set_line_speed(client.get(), 230'400));
    for (int i = 0; i < 300; ++i) port->send(frames.next(3));
    EXPECT_EQ(port->state(), PortState::wrong_speed);
    EXPECT_GT(port->counters().dropped, 0U);
    drain(client.get(), reader);
    EXPECT_GE(reader.numbers.size(), sent) << "the garbage is behind them";
    port->flush();
    read_all(client.get());
    for (int i = 0; i < 10; ++i) port->send(frames.next(3));
    EXPECT_FALSE(read_some(client.get()).empty());
    ASSERT_TRUE(set_line_speed(client.get(), 115'200));
  }
  EXPECT_EQ(port->receive(), std::nullopt);
  EXPECT_EQ(port->state(), PortState::no_reader);
  const FileDescriptor client = open_terminal(link);
  NumberedReader next;
  const std::uint32_t first = frames.made();
  port->send(frames.next(20));
  drain(client.get(), next);
  ASSERT_EQ(next.numbers.size(), 20U);
  EXPECT_EQ(next.numbers.front(), first);
  EXPECT_EQ(port->counters().sent + port->counters().dropped, frames.made());
}

// On the real clock: nothing is early, nothing is lost, everything is in order.
TEST_F(PtyLine, CharactersTakeTheirTime) {
  const auto port = paced_device({57'600, Parity::odd, 2});  // 12 bits: 208 us
  EXPECT_EQ(port->next_flush(), std::nullopt);
  const FileDescriptor client = open_terminal(link);
  const auto some = frames.next(8);
  const std::size_t all = together(some).size();
  const HostTime begin = host_now();
  port->send(some);
  std::size_t seen = 0;
  const HostTime too_late = begin + std::chrono::seconds(60);
  while (seen < all && host_now() < too_late) {
    if (const auto due = port->next_flush(); due && *due > host_now()) ::poll(nullptr, 0, 1);
    port->flush();
    const auto bytes = read_some(client.get(), 65536, 1);
    reader.feed(bytes);
    seen += bytes.size();
    ASSERT_GE(seconds(host_now() - begin), static_cast<double>(seen) * 12 / 57'600) << seen;
    if (seen < all - 14) {
      EXPECT_FALSE(port->is_drained());
    }
  }
  EXPECT_EQ(reader.numbers.size(), 8U);
  EXPECT_EQ(reader.broken + reader.unfinished(), 0U);
  EXPECT_EQ(port->counters().sent, 8U);
  EXPECT_EQ(port->next_flush(), std::nullopt);
  for (int ms = 0; ms < 10'000 && !port->is_drained(); ++ms) ::poll(nullptr, 0, 1);
  EXPECT_TRUE(port->is_drained());
}

TEST_F(PtyLine, AnAnswerGoesOutAtTheOldSpeedThenTheNewOneHolds) {
  const auto port = paced_device({9600});
  const FileDescriptor client = open_terminal(link);
  const auto wait_until_out = [&] {
    for (int i = 0; i < 5000 && port->next_flush(); ++i) {
      ::poll(nullptr, 0, 1);
      port->flush();
    }
  };
  const HostTime begin = host_now();
  const auto answer = frames.next(1);
  port->send(answer);
  port->set_line({921'600});
  EXPECT_EQ(port->state(), PortState::ready) << "the answer is on its way";
  wait_until_out();
  EXPECT_GE(seconds(host_now() - begin), static_cast<double>(together(answer).size()) * 10 / 9600);
  drain(client.get(), reader);
  EXPECT_EQ(reader.numbers.size(), 1U);
  const auto some = frames.next(4);
  port->send(some);
  wait_until_out();
  EXPECT_EQ(port->state(), PortState::wrong_speed);
  EXPECT_EQ(read_all(client.get()), garbled({921'600}, 9600, some));
  ASSERT_TRUE(set_line_speed(client.get(), 921'600));
  port->send(frames.next(2));
  wait_until_out();
  drain(client.get(), reader);
  EXPECT_EQ(reader.numbers.size(), 3U);
  EXPECT_EQ(port->counters().sent, frames.made());
}

TEST_F(PtyLine, APacedLineKeepsNothingForTheNextReader) {
  const auto port = paced_device({9600});
  {
    const FileDescriptor client = open_terminal(link);
    port->send(frames.next(20));
    EXPECT_TRUE(port->next_flush().has_value());
    ::poll(nullptr, 0, 30);
    port->flush();
  }
  EXPECT_EQ(port->receive(), std::nullopt);
  EXPECT_EQ(port->next_flush(), std::nullopt);
  EXPECT_EQ(port->counters().sent + port->counters().dropped, 20U);
  port->send(frames.next(1));
  EXPECT_EQ(port->next_flush(), std::nullopt) << "nobody is there";
  const FileDescriptor client = open_terminal(link);
  port->send(frames.next(1));
  for (int i = 0; i < 5000 && port->next_flush(); ++i) {
    ::poll(nullptr, 0, 1);
    port->flush();
  }
  drain(client.get(), reader);
  EXPECT_EQ(reader.numbers, (std::vector<std::uint32_t>{21}));
}

// A full pty neither tears frames nor makes a loop that waits for next_flush() spin.
TEST_F(PtyLine, AReaderOfAPacedLineThatStopsTearsNoFrame) {
  const auto port = paced_device({4'000'000});
  const FileDescriptor client = open_terminal(link);
  for (int i = 0; i < 700; ++i) {  // 75 kB
    port->send(frames.next(1));
    while (port->next_flush() && *port->next_flush() < host_now()) port->flush();
  }
  EXPECT_GT(port->counters().dropped, 0U);
  ASSERT_TRUE(port->next_flush().has_value());
  for (int i = 0; i < 1000 && port->next_flush(); ++i) {
    reader.feed(read_some(client.get(), 4096, 1));
    port->flush();
  }
  drain(client.get(), reader);
  EXPECT_EQ(reader.broken + reader.unfinished(), 0U);
  EXPECT_EQ(reader.numbers.size(), port->counters().sent);
  EXPECT_EQ(port->counters().sent + port->counters().dropped, frames.made());
}

TEST_F(PtyLine, NamesTheFault) {
  EXPECT_TRUE(mentions(error_of("pty:" + link, paced({})), "give baud"));
  EXPECT_EQ(error_of("pty:" + link + "?baud=9600", paced({})), "");
  EXPECT_TRUE(mentions(error_of("pty:" + link + "?speed=5"), "right would be one of: line any"));
  EXPECT_TRUE(mentions(error_of("pty:" + link + "?parity=mark"), "right would be one of: none even odd"));
  EXPECT_TRUE(mentions(error_of("pty:" + link + "?stop=3"), "from 1 to 2"));
  EXPECT_TRUE(mentions(error_of("pty:" + link + "?pace=line"), "unknown option"));
  EXPECT_TRUE(mentions(error_of("pty:" + link + "?parity=odd", Role::listener), "unknown option"));
}

}  // namespace
}  // namespace imud
