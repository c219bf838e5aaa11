// A pty whose keeper holds it while its device comes and goes.
#include "transports/uart/pty_keeper.hpp"

#include <gtest/gtest.h>
#include <sys/eventfd.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <termios.h>

#include <csignal>
#include <thread>

#include "tests/transports/port_error.hpp"
#include "tests/transports/scratch_folder.hpp"
#include "tests/transports/terminal.hpp"
#include "transports/host_clock.hpp"
#include "transports/uart/termios2.hpp"

namespace imud {
namespace {

namespace fs = std::filesystem;

class Keeper : public ::testing::Test {
 protected:
  Keeper() { begin(); }
  ~Keeper() override { end(); }
  void begin() {
    std::array<int, 2> ends{};
    if (::pipe2(ends.data(), O_CLOEXEC) != 0) throw std::runtime_error("no pipe");
    stopped_.reset(ends[0]);
    stop_.reset(ends[1]);
    keepers_.push_back(std::make_unique<PtyKeeper>(link));
    keepers_.push_back(std::make_unique<PtyKeeper>(folder / "imu2"));
    thread_ = std::jthread([this] { PtyKeeper::serve(keepers_, stopped_.get()); });
  }
  void end() {
    stop_.reset();
    if (thread_.joinable()) thread_.join();
    keepers_.clear();
  }
  // Opens the device, again while its keeper has not answered in time, as on a busy machine.
  std::unique_ptr<Port> device(const std::string& options = "") const {
    const HostTime until = host_now() + std::chrono::minutes(1);
    for (;;) try {
        return open_port("pty:" + link + options, Role::device);
      } catch (const PortError& error) {
        if (!mentions(error.what(), "does not answer") || host_now() > until) throw;
      }
  }
  // Returns false if `condition` does not hold within a minute.
  template <class Condition>
  static bool within_a_minute(Condition condition) {
    const HostTime until = host_now() + std::chrono::minutes(1);
    while (!condition())
      if (host_now() > until) return false;
    return true;
  }
  // Returns a process that holds the pty of `link`.
  static pid_t start_process(const std::string& link) {
    std::array<int, 2> ready{};
    if (::pipe2(ready.data(), O_CLOEXEC) != 0) throw std::runtime_error("no pipe");
    const FileDescriptor read(ready[0]);
    FileDescriptor write(ready[1]);
    const pid_t child = ::fork();
    if (child == 0) {
      ::prctl(PR_SET_PDEATHSIG, SIGKILL);
      try {
        std::vector<std::unique_ptr<PtyKeeper>> keepers;
        keepers.push_back(std::make_unique<PtyKeeper>(link));
        [[maybe_unused]] const ssize_t written = ::write(write.get(), "r", 1);
        PtyKeeper::serve(keepers, ::eventfd(0, EFD_CLOEXEC));
      } catch (const PortError&) {
      }
      ::_exit(0);
    }
    write.reset();
    char answer = 0;
    EXPECT_EQ(::read(read.get(), &answer, 1), 1) << "no keeper";
    return child;
  }
  static void connect_without_waiting(const std::string& link) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    (link + ".keeper").copy(address.sun_path, sizeof address.sun_path - 1);
    const FileDescriptor socket(::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
    static_cast<void>(::connect(socket.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address));
  }
  static bool is_hung_up(const FileDescriptor& client) {
    pollfd events{client.get(), POLLIN, 0};
    ::poll(&events, 1, 0);
    return (events.revents & (POLLHUP | POLLERR)) != 0;
  }

  ScratchFolder folder;
  const std::string link = folder / "imu1";
  NumberedFrames frames;
  NumberedReader reader;

 private:
  FileDescriptor stopped_, stop_;
  std::vector<std::unique_ptr<PtyKeeper>> keepers_;
  std::jthread thread_;
};

TEST_F(Keeper, AClientIsNotHungUpWhileItsDeviceIsAway) {
  const FileDescriptor client = open_terminal(link);
  for (std::size_t round = 1; round <= 3; ++round) {
    const auto port = device();
    port->send(frames.next(10));
    EXPECT_EQ(port->counters().dropped, 0U);
    drain(client.get(), reader);
    EXPECT_EQ(reader.numbers.size(), 10 * round);
    const std::string command = "command";
    ASSERT_EQ(::write(client.get(), command.data(), command.size()), 7);
    pollfd ready{port->descriptor(), POLLIN, 0};
    ASSERT_EQ(::poll(&ready, 1, 5000), 1);
    const auto received = port->receive();
    ASSERT_TRUE(received);
    EXPECT_EQ(received->frame.bytes.size(), 7U);
    EXPECT_FALSE(is_hung_up(client));
  }
  EXPECT_FALSE(is_hung_up(client));
  EXPECT_TRUE(fs::is_symlink(link));
  end();
  EXPECT_TRUE(is_hung_up(client)) << "otherwise is_hung_up() proves nothing";
}

// A sensor without power receives nothing.
TEST_F(Keeper, WhatAClientSendsWhileItsDeviceIsAwayIsLost) {
  device();
  const FileDescriptor client = open_terminal(link);
  ASSERT_EQ(::write(client.get(), "lost", 4), 4);
  const auto port = device();
  ASSERT_EQ(::write(client.get(), "new", 3), 3);
  pollfd ready{port->descriptor(), POLLIN, 0};
  ASSERT_EQ(::poll(&ready, 1, 5000), 1);
  const auto received = port->receive();
  ASSERT_TRUE(received);
  EXPECT_EQ(received->frame.bytes.size(), 3U);
}

TEST_F(Keeper, ANewClientGetsNothingThatAFormerOneLeft) {
  {
    const FileDescriptor former = open_terminal(link);
    device()->send(frames.next(10));
  }
  const auto port = device();
  const FileDescriptor client = open_terminal(link);
  port->send(frames.next(1));
  drain(client.get(), reader);
  EXPECT_EQ(reader.numbers, std::vector<std::uint32_t>{10});
}

TEST_F(Keeper, TheClientsSpeedRemainsAndIsCompared) {
  const FileDescriptor client = open_terminal(link);
  auto port = device("?baud=115200");
  EXPECT_EQ(line_speed(client.get()), 115200U) << "the first device sets the line's speed";
  ASSERT_TRUE(set_line_speed(client.get(), 921600));
  port.reset();
  port = device("?baud=115200");
  EXPECT_EQ(line_speed(client.get()), 921600U);
  port->send(frames.next(1));
  EXPECT_EQ(port->state(), PortState::wrong_speed);
}

// A client that sets no speed has that of the line, whichever device comes next.
TEST_F(Keeper, TheSpeedOfAnEarlierDeviceIsNotTheClients) {
  const FileDescriptor client = open_terminal(link);
  for (const unsigned baud : {115200U, 921600U, 230400U}) {
    const auto port = device("?baud=" + std::to_string(baud));
    EXPECT_EQ(line_speed(client.get()), baud);
    port->send(frames.next(1));
    EXPECT_EQ(port->state(), PortState::ready);
  }
  // The client sets the speed that the line has.
  termios line{};
  ASSERT_EQ(::tcgetattr(client.get(), &line), 0);
  ::cfsetspeed(&line, B230400);
  ASSERT_EQ(::tcsetattr(client.get(), TCSANOW, &line), 0);
  const auto port = device("?baud=115200");
  EXPECT_EQ(line_speed(client.get()), 230400U);
}

TEST_F(Keeper, OneDeviceHasThePty) {
  const auto port = device();
  EXPECT_TRUE(mentions(error_of("pty:" + link), "another process has it"));
  EXPECT_EQ(error_of("pty:" + (folder / "imu2")), "") << "each link has a pty of its own";
  const FileDescriptor client = open_terminal(link);
  port->send(frames.next(1));
  drain(client.get(), reader);
  EXPECT_EQ(reader.numbers.size(), 1U);
}

TEST_F(Keeper, OneKeeperHoldsALink) {
  EXPECT_THROW(PtyKeeper(this->link), PortError);
  EXPECT_NE(device(), nullptr);
}

// As for a device without a keeper.
TEST_F(Keeper, WithoutItsKeeperADeviceGoesOnUntilItEnds) {
  auto port = device();
  const FileDescriptor client = open_terminal(link);
  end();
  EXPECT_FALSE(fs::exists(fs::symlink_status(link)));
  EXPECT_FALSE(fs::exists(link + ".keeper"));
  port->send(frames.next(5));
  drain(client.get(), reader);
  EXPECT_EQ(reader.numbers.size(), 5U);
  port.reset();
  EXPECT_TRUE(is_hung_up(client));
}

// Its client reopens the link, as with every device that was lost.
TEST_F(Keeper, ADeviceFollowsAKeeperThatIsStartedAgain) {
  const auto port = device("?baud=921600");
  const FileDescriptor former = open_terminal(link);
  port->send(frames.next(5));
  drain(former.get(), reader);
  for (std::size_t round = 1; round <= 2; ++round) {
    end();
    port->send(frames.next(1));
    begin();
    const FileDescriptor client = open_terminal(link);
    NumberedReader next;
    ASSERT_TRUE(within_a_minute([&] {
      port->receive();
      port->send(frames.next(1));
      next.feed(read_some(client.get(), 65536, 1));
      return next.numbers.size() >= 10;
    }));
    EXPECT_EQ(port->counters().lost_count, round);
    EXPECT_EQ(next.broken, 0U);
    EXPECT_EQ(line_speed(client.get()), 921600U);
    EXPECT_TRUE(mentions(error_of("pty:" + link), "another process has it"));
  }
  EXPECT_TRUE(is_hung_up(former));
}

// Device and client go on with the pty of the keeper that was killed; its link does not hinder the next keeper.
TEST_F(Keeper, ADeviceFollowsAKeeperThatWasKilled) {
  const std::string killed_link = folder / "imu3";
  const pid_t keeper = start_process(killed_link);
  const auto port = open_port("pty:" + killed_link, Role::device);
  const FileDescriptor former = open_terminal(killed_link);
  ::kill(keeper, SIGKILL);
  ::waitpid(keeper, nullptr, 0);
  port->send(frames.next(3));
  drain(former.get(), reader);
  EXPECT_EQ(reader.numbers.size(), 3U);
  const pid_t next_keeper = start_process(killed_link);
  const FileDescriptor client = open_terminal(killed_link);
  EXPECT_TRUE(within_a_minute([&] {
    port->receive();
    port->send(frames.next(1));
    return !read_some(client.get(), 65536, 1).empty();
  }));
  ::kill(next_keeper, SIGKILL);
  ::waitpid(next_keeper, nullptr, 0);
}

TEST_F(Keeper, AKeeperThatIsStoppedIsNamed) {
  const std::string stopped_link = folder / "imu3";
  const pid_t keeper = start_process(stopped_link);
  ::kill(keeper, SIGSTOP);
  for (int i = 0; i < 12; ++i) {  // more than its queue holds
    if (i > 0 && i < 11) {
      connect_without_waiting(stopped_link);
      continue;
    }
    EXPECT_TRUE(mentions(error_of("pty:" + stopped_link), "its keeper does not answer; is that process stopped?"));
  }
  ::kill(keeper, SIGCONT);
  EXPECT_TRUE(within_a_minute([&] { return error_of("pty:" + stopped_link).empty(); }));
  ::kill(keeper, SIGKILL);
  ::waitpid(keeper, nullptr, 0);
}

TEST_F(Keeper, ThePortOfAConfigurationNamesItsLink) {
  const std::string other = folder / "imu3";
  {
    const PtyKeeper keeper("pty:" + other + "?mode=0640");
    EXPECT_EQ(keeper.link(), other);
    struct stat status {};
    ASSERT_EQ(::stat(other.c_str(), &status), 0);
    EXPECT_EQ(status.st_mode & 0777U, 0640U);
  }
  EXPECT_FALSE(fs::exists(fs::symlink_status(other)));
  EXPECT_THROW(PtyKeeper("pty:" + other + "?baud=9600"), PortError) << "the speed is the device's";
}

TEST_F(Keeper, TheSocketOfAKeeperThatWasKilledIsReplaced) {
  end();
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  const std::string path = link + ".keeper";
  ASSERT_LT(path.size(), sizeof address.sun_path);
  path.copy(address.sun_path, path.size());
  {
    const FileDescriptor socket(::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0));
    ASSERT_EQ(::bind(socket.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
  }
  ASSERT_TRUE(fs::exists(path));
  EXPECT_NE(device(), nullptr) << "which makes its own pty";
  begin();
  device();
  EXPECT_TRUE(fs::is_symlink(link)) << "the keeper's";
}

TEST_F(Keeper, APathThatIsTooLongForASocketIsNamed) {
  const std::string long_link = folder / std::string(100, 'x');
  EXPECT_THROW(PtyKeeper{long_link}, PortError);
  EXPECT_FALSE(fs::exists(fs::symlink_status(long_link)));
  EXPECT_NE(open_port("pty:" + long_link, Role::device), nullptr) << "without a keeper any length will do";
}

}  // namespace
}  // namespace imud
