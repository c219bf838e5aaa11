// Products behind a pty: clients that close and reopen it, and power that is switched off and on.
#include <fcntl.h>
#include <signal.h>
#include <termios.h>
#include <unistd.h>

#include "tests/emulator/run/live_test.hpp"
#include "tests/support/text.hpp"

namespace imud {
namespace {

class DeviceTest : public LiveTest {
 protected:
  // Runs `imu` (the keys of [[imu]] but its port) in lockstep.
  void begin(const std::string& imu) {
    start(imud_, write("config.toml",
                       fmt::format("clock = \"lockstep\"\n[truth]\nport = \"{}\"\n[[imu]]\nport = \"pty:{}\"\n{}\n",
                                   simulator_.port(), path("imu"), imu)));
    ASSERT_TRUE(eventually([&] { return std::filesystem::is_symlink(path("imu")); }));
    ASSERT_TRUE(step());
  }
  // Sends the next truth, 10 ms after the one before, and waits for its samples.
  bool step() {
    const bool done = simulator_.exchange(Simulator::truth(10 * sequence_, sequence_, true)).has_value();
    ++sequence_;
    return done;
  }
  FileDescriptor open_client(const std::string& name = "imu") const {
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
  // Returns what the client receives during that many truths.
  std::string listen(const FileDescriptor& client, int truths) {
    std::string bytes;
    std::array<char, 4096> buffer;
    for (int i = 0; i < truths; ++i) {
      if (!step()) return "no answer";
      for (ssize_t size = 1; size > 0;) {
        size = ::read(client.get(), buffer.data(), buffer.size());
        if (size > 0) bytes.append(buffer.data(), static_cast<std::size_t>(size));
      }
    }
    return bytes;
  }

  Program imud_{"imud"};
  std::uint32_t sequence_ = 0;
};

TEST_F(DeviceTest, AClientThatReturnsFindsTheDeviceAsItLeftIt) {
  begin("protocol = \"vectornav\"");
  {
    const FileDescriptor client = open_client();
    EXPECT_GT(count(listen(client, 100), "$VNYMR,"), 30U) << "out of the box";
    send(client, "$VNWRG,06,0*6C\r\n$VNWRG,75,3,20,1,529*4A\r\n");
    const std::string bytes = listen(client, 20);
    EXPECT_EQ(count(bytes, "$VNWRG,06,0*6C\r\n"), 1U);
    EXPECT_GT(count(bytes, std::string("\xFA\x01\x29\x05", 4)), 3U);
  }
  listen(FileDescriptor(), 20);  // without a client
  const FileDescriptor client = open_client();
  const std::string bytes = listen(client, 100);
  EXPECT_NEAR(static_cast<double>(count(bytes, std::string("\xFA\x01\x29\x05", 4))), 40, 2);
  EXPECT_EQ(count(bytes, "$VN"), 0U);
  imud_.stop();
}

// Also after an answer, a run that is not in real time waits for its reader.
TEST_F(DeviceTest, AfterAReplyASlowReaderMissesNothing) {
  begin("protocol = \"vectornav\"");
  const FileDescriptor client = open_client();
  send(client, "$VNRRG,01*72\r\n");
  ASSERT_EQ(count(listen(client, 20), "$VNRRG,01,"), 1U);
  constexpr std::uint32_t truths = 200;  // 20 s of 40 messages of some 120 bytes: four times what a pty holds
  for (std::uint32_t i = 1; i <= truths; ++i)
    simulator_.send(Simulator::encode(Simulator::truth(10 * (sequence_ - 1) + 100 * i, sequence_ + i, true)));
  std::string bytes;
  std::array<char, 256> buffer;
  int answers = 0;
  ASSERT_TRUE(eventually([&] {
    const ssize_t size = ::read(client.get(), buffer.data(), buffer.size());
    if (size > 0) bytes.append(buffer.data(), static_cast<std::size_t>(size));
    while (simulator_.answer(0)) ++answers;
    return answers == truths && size <= 0;
  }));
  imud_.stop();
  EXPECT_NEAR(static_cast<double>(count(bytes, "$VNYMR,")), 800, 1);
  EXPECT_EQ(summary()["imus"][0]["dropped"], 1) << "the message before the client was there";
}

// Power may be switched repeatedly.
TEST_F(DeviceTest, PowerOffAndOnShowsAVectorNavsStoredSettings) {
  begin("protocol = \"vectornav\"");
  const FileDescriptor client = open_client();
  send(client, "$VNWRG,06,1*6D\r\n$VNWNV*57\r\n");
  for (std::size_t times = 1; times <= 3; ++times) {
    send(client, "$VNWRG,06,0*6C\r\n");
    listen(client, 2);
    EXPECT_EQ(count(listen(client, 50), "$VN"), 0U);
    imud_.kill(SIGUSR1);
    ASSERT_TRUE(eventually([&] { return count(imud_.errors(), "power off and on") == times; })) << times;
    EXPECT_GT(count(listen(client, 100), "$VNYPR,"), 30U);
  }
  imud_.stop();
}

// The stored speed of the line returns, too: the client, still at its old speed, receives valid data again.
TEST_F(DeviceTest, PowerOffAndOnBringsBackTheLinesSpeed) {
  begin("protocol = \"vectornav\"");
  const FileDescriptor client = open_client();
  EXPECT_GT(count(listen(client, 50), "$VNYMR,"), 10U);
  send(client, "$VNWRG,05,921600*53\r\n");
  listen(client, 2);
  EXPECT_EQ(count(listen(client, 50), "$VNYMR,"), 0U);
  imud_.kill(SIGUSR1);
  ASSERT_TRUE(imud_.wait_for_errors("power off and on"));
  EXPECT_GT(count(listen(client, 50), "$VNYMR,"), 10U);
  imud_.stop();
}

// Part number, serial number, configuration; then measurements with the status start-up.
TEST_F(DeviceTest, PowerOffAndOnShowsAStim300sStart) {
  begin("protocol = \"stim300\"");
  const FileDescriptor client = open_client();
  listen(client, 120);  // more than a second
  const std::string part_number = "\xB1\x08\x41\x67";
  EXPECT_EQ(count(listen(client, 50), part_number), 0U);
  imud_.kill(SIGUSR1);
  ASSERT_TRUE(imud_.wait_for_errors("power off and on"));
  const std::string bytes = listen(client, 50);
  const std::size_t part = bytes.find(part_number), serial = bytes.find("\xB5N"), configuration = bytes.find("\xBC");
  ASSERT_NE(configuration, std::string::npos);
  EXPECT_LT(part, serial);
  EXPECT_LT(serial, configuration);
  const std::size_t measurement = bytes.find('\xA7', configuration + 26);
  ASSERT_LT(measurement + 59, bytes.size());
  EXPECT_EQ(bytes[measurement + 10] & 0x40, 0x40) << "start-up";
  imud_.stop();
}

TEST_F(DeviceTest, PowerOffAndOnEndsAMipDevicesIdle) {
  begin("protocol = \"mip\"");
  const FileDescriptor client = open_client();
  const std::string packet("\x75\x65\x80", 3);
  EXPECT_GT(count(listen(client, 50), packet), 30U);
  send(client, std::string("\x75\x65\x01\x02\x02\x02\xE1\xC7", 8));
  listen(client, 2);
  EXPECT_EQ(count(listen(client, 50), packet), 0U);
  imud_.kill(SIGUSR1);
  ASSERT_TRUE(imud_.wait_for_errors("power off and on"));
  EXPECT_GT(count(listen(client, 50), packet), 30U);
  imud_.stop();
}

// In real time, a sample is prepared when the command arrives in most cases.
TEST_F(DeviceTest, NoDatagramFollowsTheAnswerToACommandThatEndsNormalMode) {
  std::size_t entered = 0;
  for (const std::string rate : {"1000", "2000"}) {
    Program imud("imud");
    start(imud, write("config.toml",
                      fmt::format("[truth]\nport = \"{}\"\n[[imu]]\nprotocol = \"stim300\"\nport = \"pty:{}\"\n"
                                  "device.sample_rate = {}\ndevice.bit_rate = 1843200\ndevice.start_up = false\n",
                                  simulator_.port(), path("imu" + rate), rate)));
    ASSERT_TRUE(eventually([&] { return std::filesystem::is_symlink(path("imu" + rate)); }));
    const FileDescriptor client = open_client("imu" + rate);
    std::string bytes;
    // Reads until `end` is received, and returns everything up to there.
    const auto read_to = [&](std::string_view end) {
      std::array<char, 4096> buffer;
      bytes.clear();
      const bool found = eventually([&] {
        const ssize_t size = ::read(client.get(), buffer.data(), buffer.size());
        if (size > 0) bytes.append(buffer.data(), static_cast<std::size_t>(size));
        return bytes.find(end) != std::string::npos;
      });
      return found ? bytes.substr(bytes.find(end) + end.size()) : "no end";
    };
    const std::string measurement = "\xA7";
    for (int i = 0; i < 40; ++i) {
      ASSERT_NE(read_to(measurement), "no end");
      send(client, "SERVICEMODE\r");
      ASSERT_NE(read_to("SERIAL NUMBER = "), "no end");
      std::string after = bytes.substr(bytes.find("SERIAL NUMBER = "));
      if (after.find("\r>") == std::string::npos) {
        ASSERT_NE(read_to("\r>"), "no end");
        after += bytes;
      }
      EXPECT_TRUE(after.ends_with("\r>")) << i << " at " << rate << " Hz";
      send(client, "\r");
      EXPECT_EQ(read_to("\r>"), "");
      EXPECT_EQ(bytes, "\r>") << i << " at " << rate << " Hz";
      send(client, "x N\r");
      ASSERT_NE(read_to(measurement), "no end");

      send(client, "UTILITYMODE\r");
      EXPECT_EQ(read_to("#UTILITYMODE,234\r"), "") << i << " at " << rate << " Hz";
      send(client, "$isn,28\r");
      EXPECT_EQ(read_to("\r"), "");
      EXPECT_TRUE(bytes.starts_with("#isn,0,N")) << i << " at " << rate << " Hz";
      send(client, "$xn,150\r");
      entered += 2;
    }
    imud.stop();
  }
  EXPECT_EQ(entered, 160U);
}

// imud is killed and begins again; its client, which has the pty open all the time, notices only a pause.
TEST_F(DeviceTest, AClientOfAKeptPtyIsNotHungUpWhenImudIsKilled) {
  Program keeper("imud");
  keeper.start({"pty", path("imu")});
  ASSERT_TRUE(keeper.wait_for_output("is held"));
  const FileDescriptor client = open_client();
  const std::string config = write(
      "config.toml", fmt::format("[truth]\nport = \"{}\"\n[[imu]]\nprotocol = \"vectornav\"\nport = \"pty:{}\"\n",
                                 simulator_.port(), path("imu")));
  for (int i = 0; i < 3; ++i) {
    Program imud("imud");
    start(imud, config);
    std::string bytes;
    std::array<char, 4096> buffer;
    ASSERT_TRUE(eventually([&] {
      const ssize_t size = ::read(client.get(), buffer.data(), buffer.size());
      if (size > 0) bytes.append(buffer.data(), static_cast<std::size_t>(size));
      return count(bytes, "$VNYMR,") > 5;
    })) << i;
    EXPECT_EQ(imud.stop(SIGKILL), 128 + SIGKILL);
    while (::read(client.get(), buffer.data(), buffer.size()) > 0) {
    }
    EXPECT_EQ(errno, EAGAIN) << "no end of the file";
    pollfd events{client.get(), POLLIN | POLLOUT, 0};
    EXPECT_EQ(::poll(&events, 1, 0), 1);
    EXPECT_EQ(events.revents, POLLOUT) << "no hang-up";
  }
  EXPECT_EQ(keeper.stop(), 0);
  EXPECT_FALSE(std::filesystem::exists(std::filesystem::symlink_status(path("imu"))));
}

}  // namespace
}  // namespace imud
