// How a run reports that it is ready, the UDP ports that the system has chosen, and the wait for readers.
#include <fcntl.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <array>
#include <csignal>
#include <cstddef>
#include <regex>

#include "tests/emulator/run/live_test.hpp"
#include "tests/support/text.hpp"
#include "tests/transports/terminal.hpp"

namespace imud {
namespace {

class ReadinessTest : public LiveTest {
 protected:
  ReadinessTest() {
    std::array<int, 2> ends{};
    if (::pipe(ends.data()) != 0) throw std::runtime_error("no pipe");
    ready_.reset(ends[0]);
    to_imud_.reset(ends[1]);
    ::fcntl(ready_.get(), F_SETFD, FD_CLOEXEC);
  }
  std::vector<std::string> ready_fd() const { return {"--ready-fd", std::to_string(to_imud_.get())}; }
  // Returns what imud has written to --ready-fd, once it has closed it.
  std::string ready_text() {
    to_imud_.reset();
    std::string all;
    std::array<char, 64> buffer{};
    for (ssize_t size = 0; (size = ::read(ready_.get(), buffer.data(), buffer.size())) > 0;)
      all.append(buffer.data(), static_cast<std::size_t>(size));
    return all;
  }
  std::string pty_config() const {
    return config("realtime", simulator_.port(), "native", 200, "native", "pty:" + path("imu"));
  }
  // Truths of 3 s at 100 Hz.
  std::string capture() const {
    EXPECT_EQ(run_program("imu-truth", {"spiral", "--csv", path("truth.csv"), "--for", "3"}).exit_code, 0);
    return path("truth.csv");
  }
  std::string replay_config() const {
    return config("fast", simulator_.port(), "csv", 100, "native", "pty:" + path("imu"));
  }

 private:
  FileDescriptor ready_, to_imud_;
};

// The socket at which a service manager is notified.
class Manager {
 public:
  // `name`: as in NOTIFY_SOCKET; a path, or @ and an abstract name.
  explicit Manager(const std::string& name) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    name.copy(address.sun_path, sizeof address.sun_path - 1);
    if (name.starts_with('@')) address.sun_path[0] = '\0';
    const std::size_t size = offsetof(sockaddr_un, sun_path) + name.size();
    EXPECT_EQ(::bind(socket_.get(), reinterpret_cast<const sockaddr*>(&address), static_cast<socklen_t>(size)), 0);
  }
  // Waits for the next datagram.
  std::string notified() const {
    std::array<char, 64> text{};
    const ssize_t size = ::recv(socket_.get(), text.data(), text.size(), 0);
    return std::string(text.data(), static_cast<std::size_t>(std::max<ssize_t>(size, 0)));
  }

 private:
  FileDescriptor socket_{::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0)};
};

TEST_F(ReadinessTest, AnAbstractAddressIsNotified) {
  const std::string name = "@imud-readiness-" + std::to_string(::getpid());
  const Manager manager(name);
  Program imud("imud");
  ::setenv("NOTIFY_SOCKET", name.c_str(), 1);
  start(imud, pty_config(), ready_fd());
  ::unsetenv("NOTIFY_SOCKET");
  EXPECT_EQ(ready_text(), "ready\n");
  EXPECT_EQ(manager.notified(), "READY=1");
  EXPECT_EQ(imud.stop(), 0);
  EXPECT_EQ(manager.notified(), "STOPPING=1");
}

TEST_F(ReadinessTest, ReadyIsReportedWhenTheLinkStandsBeforeAnyTruth) {
  const Manager manager(path("notify"));
  Program imud("imud");
  ::setenv("NOTIFY_SOCKET", path("notify").c_str(), 1);
  start(imud, pty_config(), ready_fd());
  ::unsetenv("NOTIFY_SOCKET");
  EXPECT_EQ(ready_text(), "ready\n");
  EXPECT_TRUE(std::filesystem::is_symlink(path("imu")));
  EXPECT_EQ(manager.notified(), "READY=1");
  EXPECT_TRUE(imud.wait_for_errors("info ready\n"));
  EXPECT_EQ(imud.stop(), 0);
  EXPECT_EQ(manager.notified(), "STOPPING=1");
  EXPECT_EQ(count(imud.errors(), "ready"), 1U);
}

TEST_F(ReadinessTest, ARunThatCannotOpenItsPortsIsNotReady) {
  write("imu", "precious");
  Program imud("imud");
  start(imud, pty_config(), ready_fd());
  EXPECT_EQ(ready_text(), "");
  EXPECT_EQ(imud.wait(), 2);
  EXPECT_FALSE(contains(imud.errors(), "ready")) << imud.errors();
}

TEST_F(ReadinessTest, ADescriptorThatIsNotOpenIsRefused) {
  for (const char* wrong : {"999", "1", "-1", "x"}) {
    const ProgramResult result = run_program("imud", {"run", pty_config(), "--ready-fd", wrong});
    EXPECT_EQ(result.exit_code, 2);
    EXPECT_TRUE(contains(result.errors, "give a descriptor from 3 that is open")) << result.errors;
  }
}

TEST_F(ReadinessTest, UdpPort0IsAFreeOneThatIsNamed) {
  const std::string c =
      write("config.toml",
            "truth.port = \"udp:127.0.0.1:0\"\n[[imu]]\nprotocol = \"stim300\"\nport = \"file:" + path("out") +
                "\"\nsync.trigger_port = \"udp:127.0.0.1:0\"\nsync.pps_port = \"udp:[::1]:0\"\n");
  Program imud("imud");
  start(imud, c);
  ASSERT_TRUE(imud.wait_for_errors("ready"));
  ASSERT_TRUE(imud.wait_for_errors("sync.pps_port is "));
  std::smatch port;
  const std::string log = imud.errors();
  ASSERT_TRUE(std::regex_search(log, port, std::regex("ready, truth.port is (udp:127.0.0.1:[1-9][0-9]*)")));
  const std::string truth_port = port[1];
  EXPECT_EQ(run_program("imu-truth", {"turntable", "--to", truth_port, "--rate", "50", "--for", "0.5"}).exit_code, 0);
  EXPECT_EQ(imud.stop(), 0);
  const auto s = summary();
  EXPECT_GT(s["truth"]["accepted"], 0);
  EXPECT_EQ(s["chosen_ports"].size(), 3U);
  EXPECT_EQ(s["chosen_ports"]["truth.port"], truth_port);
  EXPECT_TRUE(s["chosen_ports"]["imu.imu1.sync.pps_port"].get<std::string>().starts_with("udp:[::1]:"));
  const ProgramResult refused = run_program("imud", {"check", c, "--set", "imu.0.port=udp:127.0.0.1:0"});
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_TRUE(contains(refused.errors, "imu.0.port: ")) << refused.errors;
  EXPECT_TRUE(contains(refused.errors, "only a listener's port is chosen")) << refused.errors;
}

TEST_F(ReadinessTest, AReplayThatWaitsForItsReaderLosesNoFrame) {
  Program imud("imud");
  imud.start({"replay", replay_config(), capture(), "--wait-for-reader", "--summary", path("summary.json")});
  ASSERT_TRUE(imud.wait_for_errors("waiting for a reader of pty:" + path("imu")));
  EXPECT_TRUE(contains(imud.errors(), "ready"));
  const ProgramResult decoded = run_program("imu-decode", {"native", "pty:" + path("imu")});
  EXPECT_EQ(imud.wait(), 0) << imud.errors();
  EXPECT_EQ(rows(decoded.output).size(), 301U);
  EXPECT_EQ(summary()["imus"][0]["frames"], 301);
  EXPECT_EQ(count(imud.errors(), "waiting for a reader"), 1U);
  EXPECT_FALSE(contains(imud.errors().substr(0, imud.errors().find("takes frames")), "nobody has"));
}

TEST_F(ReadinessTest, ASignalEndsTheWaitForAReader) {
  for (const bool is_replay : {true, false}) {
    Program imud("imud");
    if (is_replay)
      imud.start({"replay", replay_config(), capture(), "--wait-for-reader", "--summary", path("summary.json")});
    else
      start(imud, pty_config(), {"--wait-for-reader"});
    ASSERT_TRUE(imud.wait_for_errors("waiting for a reader"));
    EXPECT_EQ(imud.stop(), is_replay ? 3 : 0);
    EXPECT_EQ(summary()["ended_by"], "signal");
    EXPECT_EQ(summary()["imus"][0]["samples"], 0);
    EXPECT_FALSE(std::filesystem::is_symlink(path("imu")));
  }
}

}  // namespace
}  // namespace imud
