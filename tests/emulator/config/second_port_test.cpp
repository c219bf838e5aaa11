// A product with two UARTs behind two ptys.
#include <fcntl.h>
#include <termios.h>
#include <unistd.h>

#include "tests/emulator/run/live_test.hpp"
#include "tests/support/text.hpp"

namespace imud {
namespace {

class SecondPortTest : public LiveTest {
 protected:
  // Runs a VN-200 in lockstep; its log is in path("log").
  void begin(const std::string& keys) {
    start(imud_, write("config.toml", fmt::format("clock = \"lockstep\"\n[truth]\nport = \"{}\"\n[[imu]]\nprotocol = "
                                                  "\"vectornav\"\ndevice.model = \"vn-200\"\nport = \"pty:{}\"\n{}\n",
                                                  simulator_.port(), path("imu"), keys)));
    ASSERT_TRUE(eventually([&] { return std::filesystem::is_symlink(path("imu")); }));
    ASSERT_TRUE(step());
  }
  bool step() {
    const bool done = simulator_.exchange(Simulator::truth(10 * sequence_, sequence_, true)).has_value();
    ++sequence_;
    return done;
  }
  FileDescriptor open_client(const char* name) const {
    FileDescriptor tty(::open(path(name).c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC));
    termios settings{};
    ::tcgetattr(tty.get(), &settings);
    ::cfmakeraw(&settings);
    ::tcsetattr(tty.get(), TCSANOW, &settings);
    return tty;
  }
  static void send(const FileDescriptor& client, std::string_view text) {
    ASSERT_EQ(::write(client.get(), text.data(), text.size()), static_cast<ssize_t>(text.size()));
  }
  // Appends to each text what its client receives during that many truths.
  void listen(std::initializer_list<std::pair<const FileDescriptor*, std::string*>> clients, int truths) {
    std::array<char, 4096> buffer;
    for (int i = 0; i < truths; ++i) {
      ASSERT_TRUE(step());
      for (const auto& [client, bytes] : clients)
        for (ssize_t size = 1; size > 0;) {
          size = ::read(client->get(), buffer.data(), buffer.size());
          if (size > 0) bytes->append(buffer.data(), static_cast<std::size_t>(size));
        }
    }
  }

  Program imud_{"imud"};
  std::uint32_t sequence_ = 0;
};

TEST_F(SecondPortTest, EachHostHasItsAnswersAndOutputs) {
  begin("second_port = \"pty:" + path("second") + "\"\ndevice.async_type = 0\n");
  const FileDescriptor first = open_client("imu"), second = open_client("second");
  ASSERT_GE(first.get(), 0);
  ASSERT_GE(second.get(), 0);
  std::string at_first, at_second;
  send(first, "$VNWRG,06,0,2*6C\r\n$VNWRG,75,2,8,01,0001*XX\r\n$VNRRG,01*72\r\n");
  send(second, "$VNRRG,06,?*XX\r\n");
  listen({{&first, &at_first}, {&second, &at_second}}, 5);
  at_first.clear();
  send(second, "$VNRRG,04*77\r\n");
  listen({{&first, &at_first}, {&second, &at_second}}, 100);
  EXPECT_EQ(at_first, "") << "the output is at the other UART";
  EXPECT_GE(count(at_second, std::string("\xFA\x01\x01\x00", 4)), 100U);
  EXPECT_EQ(count(at_second, "$VNRRG,04,2.1.0.0"), 1U);
  EXPECT_EQ(count(at_second, "$VNRRG,01"), 0U);
  EXPECT_EQ(imud_.stop(), 0);
  const auto imu = summary()["imus"][0];
  EXPECT_EQ(imu["replies"], 5);
  EXPECT_EQ(imu["unconnected_outputs"], 0);
}

// PX4-Autopilot 004d420, VectorNav.cpp: output 2 at UART 2.
TEST_F(SecondPortTest, AnOutputToAUartThatIsNotConnectedIsCounted) {
  begin("");
  const FileDescriptor first = open_client("imu");
  std::string at_first;
  send(first, "$VNWRG,06,0*6C\r\n$VNWRG,75,2,1,6,1,C*XX\r\n");
  listen({{&first, &at_first}}, 100);
  EXPECT_EQ(count(at_first, "$VNWRG,75,2,1,6,1,C*"), 1U);
  EXPECT_EQ(count(at_first, "\xFA\x06"), 0U);
  EXPECT_EQ(imud_.stop(), 0);
  EXPECT_EQ(summary()["imus"][0]["unconnected_outputs"], 1);
}

}  // namespace
}  // namespace imud
