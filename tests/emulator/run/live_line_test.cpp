// imud run with a pty as a serial line, and clients that set its speed.
#include <fcntl.h>

#include "tests/emulator/run/live_test.hpp"
#include "tests/support/text.hpp"
#include "tests/transports/terminal.hpp"
#include "transports/host_clock.hpp"
#include "transports/uart/termios2.hpp"

namespace imud {
namespace {

using namespace std::chrono_literals;

class LiveLine : public LiveTest {
 protected:
  std::string product(const std::string& protocol, const std::string& pace) const {
    const std::string truth = fmt::format("truth.port = \"{}\"\n", simulator_.port());
    return write("config.toml", truth + fmt::format("[[imu]]\nprotocol = \"{}\"\nport = \"pty:{}\"\npace = \"{}\"\n",
                                                    protocol, path("imu"), pace));
  }
  // Reads until `text` is received; returns false if it does not arrive.
  static bool receives(int client, const std::string& text) {
    std::string all;
    return eventually([&] {
      all += read_for(client, 1ms);
      return all.find(text) != std::string::npos;
    });
  }
  static std::string read_for(int client, Nanoseconds time) {
    std::string all;
    const HostTime until = host_now() + time;
    do
      for (const std::byte byte : read_some(client, 4096, 1)) all += static_cast<char>(byte);
    while (host_now() < until);
    return all;
  }
  static void send(int client, const std::string& body) {
    unsigned sum = 0;
    for (const char c : body) sum ^= static_cast<unsigned char>(c);
    const std::string words = fmt::format("${}*{:02X}\r\n", body, sum);
    EXPECT_EQ(::write(client, words.data(), words.size()), static_cast<ssize_t>(words.size()));
  }
};

TEST_F(LiveLine, AChangeOfSpeedIsAnsweredAtTheOldOneAndThenHolds) {
  for (const std::string pace : {"none", "line"}) {
    Program imud("imud");
    start(imud, product("vectornav", pace));
    ASSERT_TRUE(eventually([&] { return std::filesystem::is_symlink(path("imu")); }));
    const FileDescriptor client = open_terminal(path("imu"));
    EXPECT_EQ(line_speed(client.get()), 115'200U);
    Program truth("imu-truth");
    truth.start({"turntable", "--to", simulator_.port(), "--rate", "50", "--for", "60"});
    ASSERT_TRUE(receives(client.get(), "$VNYMR,"));

    send(client.get(), "VNWRG,05,921600");
    ASSERT_TRUE(receives(client.get(), "$VNWRG,05,921600*"));
    std::string garbage;
    EXPECT_TRUE(eventually([&] { return (garbage += read_for(client.get(), 1ms)).size() > 300; }));
    EXPECT_EQ(garbage.find("VN"), std::string::npos);
    EXPECT_TRUE(imud.wait_for_errors("the line has 921600 baud and the client 115200: both read garbage"))
        << imud.errors();

    ASSERT_TRUE(set_line_speed(client.get(), 921'600));
    EXPECT_TRUE(receives(client.get(), "$VNYMR,"));
    send(client.get(), "VNRRG,05");
    EXPECT_TRUE(receives(client.get(), "$VNRRG,05,921600*"));
    EXPECT_TRUE(eventually([&] {
      read_for(client.get(), 1ms);
      const std::string log = imud.errors();
      const std::size_t good = log.rfind("takes frames");
      return good != std::string::npos && good > log.rfind("garbage");
    })) << imud.errors();

    // Commands at another speed are not understood.
    ASSERT_TRUE(set_line_speed(client.get(), 9600));
    EXPECT_TRUE(imud.wait_for_errors("the line has 921600 baud and the client 9600"));
    read_for(client.get(), 50ms);  // everything sent before
    send(client.get(), "VNWRG,05,9600");
    EXPECT_EQ(read_for(client.get(), 200ms).find("VN"), std::string::npos);
    ASSERT_TRUE(set_line_speed(client.get(), 921'600));
    EXPECT_TRUE(receives(client.get(), "$VNYMR,"));
    truth.kill();
    EXPECT_EQ(imud.stop(), 0);
  }
}

TEST_F(LiveLine, AMismatchOfAMomentIsNotReported) {
  Program imud("imud");
  start(imud, product("vectornav", "none"));
  ASSERT_TRUE(eventually([&] { return std::filesystem::is_symlink(path("imu")); }));
  const FileDescriptor client = open_terminal(path("imu"));
  ASSERT_TRUE(imud.wait_for_errors("takes frames")) << imud.errors();
  std::size_t long_ones = 0;  // of a busy machine, which may be reported
  for (int i = 0; i < 3; ++i) {
    const HostTime begin = host_now();
    ASSERT_TRUE(set_line_speed(client.get(), 9600));
    std::this_thread::sleep_for(250ms);
    ASSERT_TRUE(set_line_speed(client.get(), 115'200));
    if (host_now() - begin >= 2s) ++long_ones;
    std::this_thread::sleep_for(250ms);
  }
  EXPECT_EQ(imud.stop(), 0);
  EXPECT_LE(count(imud.errors(), "garbage"), long_ones) << imud.errors();
}

// 124 characters of ten bits at 90 Hz: 96.9 % of the line.
TEST_F(LiveLine, NothingIsEarlyAndNothingIsLostBelowItsLoad) {
  const std::string c =
      config("realtime", simulator_.port(), "native", 90, "native", "pty:" + path("imu") + "?baud=115200");
  Program imud("imud");
  start(imud, c, {"--set", "imu.0.pace=line"});
  ASSERT_TRUE(eventually([&] { return std::filesystem::is_symlink(path("imu")); }));
  const FileDescriptor client = open_terminal(path("imu"));
  Program truth("imu-truth");
  const HostTime begin = host_now();
  truth.start({"turntable", "--to", simulator_.port(), "--rate", "50", "--for", "2"});
  std::string bytes;
  Nanoseconds longest{};  // longest time without data
  HostTime last = begin;
  const auto read = [&] {
    bytes += read_for(client.get(), 1ms);
    const HostTime now = host_now();
    longest = std::max(longest, now - std::exchange(last, now));
  };
  while (truth.is_running()) {
    read();
    ASSERT_GE(seconds(host_now() - begin), static_cast<double>(bytes.size()) * 10 / 115'200);
  }
  imud.kill();
  while (imud.is_running()) read();  // the rest
  EXPECT_EQ(imud.wait(), 0);
  write("bytes", bytes);
  const ProgramResult decoded = run_program("imu-decode", {"native", "file:" + path("bytes")});
  EXPECT_NE(decoded.errors.find("checksum   0 failures, 0 malformed"), std::string::npos) << decoded.errors;
  const auto s = summary();
  const auto imu = s["imus"][0];
  const std::uint64_t frames = imu["frames"], dropped = imu["dropped"], samples = imu["samples"];
  EXPECT_GT(samples, 100U);
  EXPECT_EQ(frames + dropped, samples);
  const std::size_t arrived = rows(decoded.output).size();
  EXPECT_LE(arrived, frames);
  // A pty holds the data of a third of a second, and waits for half a second at the end; samples that are late find
  // the line busy.
  if (longest < 200ms && imu["lateness_us"]["max"].get<double>() < 50'000) {
    EXPECT_EQ(dropped, 0U);
    EXPECT_EQ(arrived, frames);
  }
}

}  // namespace
}  // namespace imud
