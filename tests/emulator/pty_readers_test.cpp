#include "emulator/report/pty_readers.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <sys/inotify.h>
#include <unistd.h>

#include <array>
#include <cstring>
#include <fstream>

#include "tests/transports/scratch_folder.hpp"

namespace imud {
namespace {

namespace fs = std::filesystem;

// A folder in the form of /proc.
class Processes {
  ScratchFolder folder_;

 public:
  const std::string path = folder_ / "proc";

  // Adds a process that has these files open.
  void add(int number, const std::string& name, int parent, const std::vector<std::string>& files) {
    const fs::path process = fs::path(path) / std::to_string(number);
    fs::create_directories(process / "fd");
    std::ofstream(process / "stat") << fmt::format("{} ({}) S {} 1 1", number, name, parent);
    for (std::size_t i = 0; i < files.size(); ++i) fs::create_symlink(files[i], process / "fd" / std::to_string(i));
  }
};

// Counts how often the folders below are opened.
class Opened {
 public:
  explicit Opened(const std::string& path) : notes_(::inotify_init1(IN_NONBLOCK | IN_CLOEXEC)) {
    for (const fs::directory_entry& process : fs::directory_iterator(path))
      ::inotify_add_watch(notes_, (process.path() / "fd").c_str(), IN_OPEN | IN_ONLYDIR);
  }
  ~Opened() { ::close(notes_); }
  Opened(const Opened&) = delete;
  Opened& operator=(const Opened&) = delete;

  int count() {
    int sum = 0;
    alignas(inotify_event) std::array<char, 65536> buffer;
    for (ssize_t n = 0; (n = ::read(notes_, buffer.data(), buffer.size())) > 0;)
      for (ssize_t at = 0; at < n;) {
        inotify_event event{};
        std::memcpy(&event, buffer.data() + at, sizeof event);
        if ((event.mask & IN_ISDIR) != 0) ++sum;
        at += static_cast<ssize_t>(sizeof event + event.len);
      }
    return sum;
  }

 private:
  int notes_;
};

TEST(PtyReaders, FindsTheProgramsOfManyTerminalsInOneReading) {
  Processes processes;
  processes.add(10, "cat", 1, {"/dev/null", "/dev/pts/3", "/dev/pts/3"});
  processes.add(11, "screen", 1, {"/dev/pts/3", "/dev/pts/4"});
  processes.add(12, "sh", 11, {"/dev/pts/4"});  // has inherited it
  processes.add(13, "imud", 1, {"/dev/pts/3"});
  TerminalClients clients;
  constexpr int terminals = 16;
  for (int i = 0; i < terminals; ++i) clients.try_emplace(fmt::format("/dev/pts/{}", i));
  Opened opened(processes.path);
  find_terminal_clients(clients, processes.path);
  EXPECT_EQ(opened.count(), 4);
  ASSERT_EQ(clients.size(), static_cast<std::size_t>(terminals));
  for (const auto& [terminal, programs] : clients) {
    std::string names;
    for (const TerminalClient& program : programs) names += program.name + " ";
    EXPECT_EQ(names, terminal == "/dev/pts/3"   ? "cat screen "
                     : terminal == "/dev/pts/4" ? "screen "
                                                : "")
        << terminal;
  }
}

}  // namespace
}  // namespace imud
