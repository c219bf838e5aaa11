#include <gtest/gtest.h>
#include <sys/stat.h>
#include <sys/wait.h>

#include <array>
#include <atomic>
#include <cstdio>
#include <fstream>
#include <numeric>
#include <thread>

#include "tests/support/allocations.hpp"
#include "tests/transports/port_error.hpp"
#include "tests/transports/scratch_folder.hpp"
#include "tests/transports/terminal.hpp"
#include "transports/uart/termios2.hpp"

namespace imud {
namespace {

namespace fs = std::filesystem;

class Pty : public ::testing::Test {
 protected:
  std::unique_ptr<Port> device() const { return open_port("pty:" + link, Role::device); }
  std::string target() const { return fs::read_symlink(link).string(); }
  static std::uint64_t decided(const Port& port) { return port.counters().sent + port.counters().dropped; }

  ScratchFolder folder;
  const std::string link = folder / "imu1";
  NumberedFrames frames;
  NumberedReader reader;
};

TEST_F(Pty, LinkIsMadeAndRemoved) {
  {
    const auto port = device();
    EXPECT_TRUE(target().starts_with("/dev/pts/"));
    EXPECT_TRUE(fs::is_character_file(link));
  }
  EXPECT_FALSE(fs::exists(fs::symlink_status(link)));
}

TEST_F(Pty, ReportsWhetherTheReaderHasReadAll) {
  // The reader is another process, which has just begun to read; closing immediately would lose frames in most
  // rounds.
  for (int round = 0; round < 20; ++round) {
    auto port = device();
    FILE* client = ::popen(("exec 3<'" + link + "'; echo ready; cat <&3 2>/dev/null | wc -c").c_str(), "r");
    ASSERT_NE(client, nullptr);
    std::array<char, 64> line{};
    ASSERT_STREQ(::fgets(line.data(), line.size(), client), "ready\n");
    std::uint64_t sent = 0;
    for (int i = 0; i < 60; ++i) {  // less than a line holds: the reader may not have a processor for a while
      const auto some = frames.next(2);
      for (const Frame& frame : some) sent += frame.bytes.size();
      port->send(some);
    }
    EXPECT_EQ(port->counters().dropped, 0U);
    for (int ms = 0; ms < 10'000 && !port->is_drained(); ++ms) ::poll(nullptr, 0, 1);
    EXPECT_TRUE(port->is_drained());
    port.reset();
    ASSERT_NE(::fgets(line.data(), line.size(), client), nullptr);
    EXPECT_EQ(std::stoul(line.data()), sent) << round;
    ::pclose(client);
  }
}

// While a read() lasts the line looks empty, although bytes that had no room in it are still to come.
TEST_F(Pty, ALineThatHasJustBecomeEmptyIsNotTakenAsRead) {
  const auto port = device();
  const FileDescriptor client = open_terminal(link);
  port->send(frames.next(3));
  drain(client.get(), reader);
  ASSERT_EQ(reader.numbers.size(), 3U);
  EXPECT_FALSE(port->is_drained());
  for (int ms = 0; ms < 10'000 && !port->is_drained(); ++ms) ::poll(nullptr, 0, 1);
  EXPECT_TRUE(port->is_drained());
}

TEST_F(Pty, ClientIsHungUpWhileTheCableIsOut) {
  const auto port = device();
  FileDescriptor client = open_terminal(link);
  port->send(frames.next(3));
  drain(client.get(), reader);
  EXPECT_EQ(reader.numbers.size(), 3U);

  const std::uint64_t before = allocations();
  port->set_connected(false);
  port->set_connected(false);
  EXPECT_EQ(port->state(), PortState::lost);
  EXPECT_EQ(port->descriptor(), -1);
  EXPECT_EQ(port->counters().lost_count, 1U);
  pollfd hung_up{client.get(), POLLIN, 0};
  EXPECT_EQ(::poll(&hung_up, 1, 0), 1);
  EXPECT_NE(hung_up.revents & POLLHUP, 0);
  std::byte byte{};
  EXPECT_EQ(::write(client.get(), &byte, 1), -1);
  EXPECT_EQ(errno, EIO);
  port->send(frames.next(2));
  EXPECT_FALSE(port->receive());
  port->flush();
  EXPECT_TRUE(port->is_drained());
  EXPECT_EQ(port->counters().dropped, 2U);
  EXPECT_EQ(allocations() - before, 0U);
  EXPECT_FALSE(fs::exists(fs::symlink_status(link)));

  const std::uint64_t again = allocations();
  port->set_connected(true);
  EXPECT_EQ(allocations() - again, 0U);
  EXPECT_EQ(port->state(), PortState::no_reader);
  client.reset();
  client = open_terminal(link);
  port->send(frames.next(4));
  EXPECT_EQ(port->state(), PortState::ready);
  drain(client.get(), reader);
  EXPECT_EQ(reader.numbers.size(), 7U);
  EXPECT_EQ(port->counters().sent, 7U);
}

TEST_F(Pty, NameThatIsTakenMeanwhileIsLeftAlone) {
  auto port = device();
  port->set_connected(false);
  std::ofstream(link) << "mine";
  port->set_connected(true);
  EXPECT_EQ(port->state(), PortState::lost);
  fs::remove(link);
  for (int ms = 0; ms < 10'000 && port->state() == PortState::lost; ms += 10, ::poll(nullptr, 0, 10))
    port->send(frames.next(1));
  EXPECT_EQ(port->state(), PortState::no_reader);
  EXPECT_TRUE(fs::is_character_file(link));
  port.reset();
  EXPECT_FALSE(fs::exists(fs::symlink_status(link)));
}

TEST_F(Pty, LinkOfACrashedRunIsReplaced) {
  const pid_t child = ::fork();
  if (child == 0) {
    const auto port = device();
    ::_exit(0);
  }
  ::waitpid(child, nullptr, 0);
  ASSERT_TRUE(fs::is_symlink(link));
  const auto port = device();
  const FileDescriptor client = open_terminal(link);
  port->send(frames.next(1));
  drain(client.get(), reader);
  EXPECT_EQ(reader.numbers.size(), 1U);
}

TEST_F(Pty, LinkIsReplacedThoughItsNumberIsSomebodyElsesByNow) {
  SerialDevice other(folder / "other");
  const std::string slave = fs::read_symlink(folder / "other").string();
  fs::create_symlink(slave, link);
  const timespec hour_ago[2] = {{::time(nullptr) - 3600, 0}, {::time(nullptr) - 3600, 0}};
  ASSERT_EQ(::utimensat(AT_FDCWD, link.c_str(), hour_ago, AT_SYMLINK_NOFOLLOW), 0);
  const auto port = device();
  EXPECT_NE(target(), slave);
}

TEST_F(Pty, LinkThatALivingProcessServesIsLeftAlone) {
  const auto port = device();
  const std::string before = target();
  const FileDescriptor client = open_terminal(link);
  for (int i = 0; i < 3; ++i) {
    port->send(frames.next(1));
    EXPECT_FALSE(read_some(client.get()).empty());
    EXPECT_TRUE(mentions(error_of("pty:" + link), "another process serves it"));
    EXPECT_EQ(target(), before);
  }
}

TEST_F(Pty, WhatIsNoLinkToAPtyIsLeftAlone) {
  std::ofstream(link) << "precious";
  EXPECT_TRUE(mentions(error_of("pty:" + link), "left alone"));
  EXPECT_EQ(fs::file_size(link), 8U);

  const std::string to_file = folder / "to_file";
  fs::create_symlink(link, to_file);
  EXPECT_TRUE(mentions(error_of("pty:" + to_file), "left alone"));
  EXPECT_EQ(fs::read_symlink(to_file).string(), link);

  fs::create_directory(folder / "directory");
  EXPECT_TRUE(mentions(error_of("pty:" + folder / "directory"), "left alone"));
  EXPECT_TRUE(mentions(error_of("pty:" + folder / "none/imu1"), "No such file"));
  EXPECT_EQ(std::distance(fs::directory_iterator(folder / "."), {}), 3);
}

TEST_F(Pty, LinkThatIsNoLongerOursIsNotRemoved) {
  auto port = device();
  fs::remove(link);
  fs::create_symlink("/dev/null", link);
  port.reset();
  EXPECT_EQ(target(), "/dev/null");
}

TEST_F(Pty, WithoutAReaderFramesAreDiscarded) {
  const auto port = device();
  EXPECT_EQ(port->state(), PortState::no_reader);
  EXPECT_EQ(port->descriptor(), -1);
  for (int i = 0; i < 100; ++i) port->send(frames.next(3));
  EXPECT_EQ(port->counters().dropped, 300U);
  EXPECT_EQ(port->receive(), std::nullopt);
  EXPECT_FALSE(port->at_end());

  const FileDescriptor client = open_terminal(link);
  EXPECT_TRUE(read_some(client.get()).empty());
  port->send(frames.next(2));
  EXPECT_EQ(port->state(), PortState::ready);
  EXPECT_GE(port->descriptor(), 0);
  drain(client.get(), reader);
  EXPECT_EQ(reader.numbers, (std::vector<std::uint32_t>{300, 301}));
  EXPECT_EQ(reader.broken + reader.unfinished(), 0U);
  EXPECT_EQ(port->counters().sent, 2U);
}

TEST_F(Pty, NextReaderGetsNothingThatTheLastOneLeft) {
  const auto port = device();
  for (const int amount : {3, 1000}) {  // a half-empty line; a full one, with a frame written in part
    FileDescriptor client = open_terminal(link);
    for (int i = 0; i < amount; ++i) port->send(frames.next(1));
    EXPECT_EQ(port->state(), PortState::ready);
    client.reset();
    EXPECT_EQ(port->receive(), std::nullopt);
    EXPECT_EQ(port->state(), PortState::no_reader);
    EXPECT_EQ(decided(*port), frames.made());

    const std::uint32_t first = frames.made();
    client = open_terminal(link);
    NumberedReader next;
    for (int i = 0; i < 20; ++i) port->send(frames.next(1));
    drain(client.get(), next);
    ASSERT_EQ(next.numbers.size(), 20U);
    EXPECT_EQ(next.numbers.front(), first);
    EXPECT_EQ(next.broken + next.unfinished(), 0U);
    client.reset();
    port->send({});
  }
}

TEST_F(Pty, ReaderThatStopsTearsNoFrame) {
  const auto port = device();
  const FileDescriptor client = open_terminal(link);
  for (int i = 0; i < 1000; ++i) port->send(frames.next(3));
  EXPECT_GT(port->counters().dropped, 0U);
  EXPECT_EQ(port->state(), PortState::ready);
  EXPECT_EQ(port->wants_output(), decided(*port) < frames.made());
  // It resumes slowly, stops again, and then reads everything.
  for (int i = 0; i < 2000; ++i) {
    if (i % 500 < 300) reader.feed(read_some(client.get(), 400, 0));
    port->send(frames.next(2));
  }
  for (int i = 0; i < 3; ++i) {
    drain(client.get(), reader);
    port->flush();
  }
  const std::uint64_t dropped = port->counters().dropped;
  for (int i = 0; i < 50; ++i) {
    port->send(frames.next(2));
    reader.feed(read_some(client.get(), 65536, 0));
  }
  drain(client.get(), reader);
  EXPECT_EQ(port->counters().dropped, dropped);
  EXPECT_EQ(reader.broken + reader.unfinished(), 0U);
  EXPECT_EQ(reader.numbers.size(), port->counters().sent);
  EXPECT_EQ(reader.numbers.back(), frames.made() - 1);
  EXPECT_EQ(decided(*port), frames.made());
}

TEST_F(Pty, EveryByteValuePassesBothWays) {
  std::vector<std::byte> all(256);
  for (std::size_t i = 0; i < all.size(); ++i) all[i] = static_cast<std::byte>(i);
  const auto port = device();
  const FileDescriptor client = open_terminal(link);
  port->send({{Frame{all}}});
  EXPECT_EQ(read_some(client.get()), all);
  ASSERT_EQ(::write(client.get(), all.data(), all.size()), 256);
  pollfd ready{port->descriptor(), POLLIN, 0};
  ASSERT_EQ(::poll(&ready, 1, 5000), 1);
  const auto received = port->receive();
  ASSERT_TRUE(received.has_value());
  EXPECT_TRUE(std::equal(all.begin(), all.end(), received->frame.bytes.begin(), received->frame.bytes.end()));
  EXPECT_EQ(port->counters().received, 1U);
  EXPECT_TRUE(read_some(client.get()).empty()) << "no echo";
}

TEST_F(Pty, InputOfAReaderThatHasLeftIsReceived) {
  const auto port = device();
  FileDescriptor client = open_terminal(link);
  port->send(frames.next(1));
  ASSERT_EQ(::write(client.get(), "stop", 4), 4);
  client.reset();
  ::poll(nullptr, 0, 10);  // send() looks for a reader every 5 ms
  port->send(frames.next(1));
  EXPECT_EQ(port->state(), PortState::no_reader);
  const auto received = port->receive();
  ASSERT_TRUE(received.has_value());
  EXPECT_EQ(received->frame.bytes.size(), 4U);
}

TEST_F(Pty, LineHasTheSpeedAskedFor) {
  for (const unsigned baud : {9600U, 374400U, 921600U}) {
    const auto port = open_port("pty:" + link + "?baud=" + std::to_string(baud), Role::device);
    EXPECT_EQ(line_speed(open_terminal(link).get()), baud);
  }
  EXPECT_TRUE(mentions(error_of("pty:" + link + "?baud=49"), "from 50 to 4000000"));
  EXPECT_FALSE(fs::exists(fs::symlink_status(link)));
}

// A client that waits for the link finds the line as it will be.
TEST_F(Pty, TheLinkIsMadeWhenTheLineHasItsSpeedAndMode) {
  for (int round = 0; round < 100; ++round) {
    std::atomic<bool> is_waiting = false;
    std::optional<unsigned> speed;
    mode_t mode = 0;
    std::jthread client([&] {
      FileDescriptor terminal;
      is_waiting = true;
      while (!terminal) terminal.reset(::open(link.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC));
      speed = line_speed(terminal.get());
      struct stat status {};
      ::fstat(terminal.get(), &status);
      mode = status.st_mode & 0777U;
    });
    while (!is_waiting) std::this_thread::yield();
    const auto port = open_port("pty:" + link + "?baud=921600&mode=0606", Role::device);
    client.join();
    ASSERT_EQ(speed, 921600U) << round;
    ASSERT_EQ(mode, 0606U) << round;
  }
}

TEST_F(Pty, ModeOwnerAndGroupAreThoseAskedFor) {
  const std::string group = std::to_string(::getegid());
  for (const std::string& options : {"?mode=0640&group=" + group, "?mode=640&owner=" + std::to_string(::geteuid())}) {
    const auto port = open_port("pty:" + link + options, Role::device);
    struct stat status {};
    ASSERT_EQ(::stat(link.c_str(), &status), 0);
    EXPECT_EQ(status.st_mode & 0777U, 0640U);
    EXPECT_EQ(status.st_uid, ::geteuid());
    if (options.find("group") != options.npos) {
      EXPECT_EQ(status.st_gid, ::getegid());
    }
  }
  if (::geteuid() == 0) {
    const auto port = open_port("pty:" + link + "?owner=root&group=root", Role::device);
    struct stat status {};
    ASSERT_EQ(::stat(link.c_str(), &status), 0);
    EXPECT_EQ(status.st_gid, 0U);
  }
  for (const char* wrong : {"mode=999", "mode=0066", "mode=0777", "mode=rw", "mode=0200"})
    EXPECT_TRUE(mentions(error_of("pty:" + link + "?" + wrong), "an octal number from 0600 to 0666")) << wrong;
  EXPECT_TRUE(mentions(error_of("pty:" + link + "?group=no-such-group"), "there is no such group"));
  EXPECT_TRUE(mentions(error_of("pty:" + link + "?owner=no-such-user"), "there is no such user"));
  EXPECT_TRUE(mentions(error_of("pty:" + link + "?mode=0600", Role::listener), "unknown option 'mode'"));
  EXPECT_FALSE(fs::exists(fs::symlink_status(link)));
}

TEST_F(Pty, ListenerReadsUntilTheDeviceIsGone) {
  auto port = device();
  const auto listener = open_port("pty:" + link, Role::listener);
  EXPECT_EQ(listener->receive(), std::nullopt);
  EXPECT_FALSE(listener->at_end());
  port->send(frames.next(20));
  const auto hear_all = [&] {
    pollfd ready{listener->descriptor(), POLLIN, 0};
    while (::poll(&ready, 1, 100) > 0) {
      const auto received = listener->receive();
      if (!received) break;
      reader.feed(received->frame.bytes);
    }
  };
  hear_all();
  EXPECT_EQ(reader.numbers.size(), 20U);

  const std::byte answer[3] = {};
  listener->send({{Frame{answer}}});
  pollfd ready{port->descriptor(), POLLIN, 0};
  ASSERT_EQ(::poll(&ready, 1, 5000), 1);
  EXPECT_EQ(port->receive().value().frame.bytes.size(), 3U);

  EXPECT_FALSE(listener->at_end());
  port.reset();
  hear_all();
  EXPECT_EQ(listener->receive(), std::nullopt);
  EXPECT_TRUE(listener->at_end());
  EXPECT_EQ(reader.broken + reader.unfinished(), 0U);
}

TEST_F(Pty, ListenerNeedsATerminal) {
  EXPECT_TRUE(mentions(error_of("pty:" + link, Role::listener), "No such file"));
  EXPECT_TRUE(mentions(error_of("pty:/dev/null", Role::listener), "is not a terminal"));
}

}  // namespace
}  // namespace imud
