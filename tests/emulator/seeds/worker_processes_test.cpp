// Workers that die: without anyone to lose an item to they end the run, else the open item alone is done again.
#include "emulator/seeds/worker_processes.hpp"

#include <gtest/gtest.h>
#include <poll.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <csignal>
#include <map>
#include <new>
#include <stdexcept>
#include <string>

namespace imud {
namespace {

// How often each item was begun, in memory that the workers share.
class Begins {
 public:
  static constexpr std::size_t items = 40;
  Begins()
      : counts_(new (::mmap(nullptr, sizeof(std::atomic<int>[items]), PROT_READ | PROT_WRITE,
                            MAP_SHARED | MAP_ANONYMOUS, -1, 0)) std::atomic<int>[items]()) {}
  ~Begins() { ::munmap(counts_, sizeof(std::atomic<int>[items])); }
  Begins(const Begins&) = delete;
  Begins& operator=(const Begins&) = delete;
  std::atomic<int>& of(std::size_t item) { return counts_[item]; }

 private:
  std::atomic<int>* const counts_;
};

TEST(WorkerProcesses, ADeathCostsTheOpenItemAlone) {
  for (const unsigned jobs : {1U, 3U}) {
    Begins begins;
    std::map<std::size_t, int> taken, lost;
    std::string cause;
    const bool is_whole = run_workers({.jobs = jobs,
                                       .work =
                                           [&](std::size_t item) {
                                             const int before = begins.of(item)++;
                                             const bool dies = item == 11 || (item % 10 == 7 && before == 0);
                                             if (dies) std::raise(SIGKILL);
                                             return std::to_string(item * item);
                                           },
                                       .take =
                                           [&](std::size_t item, const std::string& text) {
                                             ++taken[item];
                                             EXPECT_EQ(text, std::to_string(item * item));
                                           },
                                       .lose =
                                           [&](std::size_t item, const std::string& why) {
                                             ++lost[item];
                                             cause = why;
                                           }},
                                      Begins::items);
    EXPECT_TRUE(is_whole);
    EXPECT_EQ(lost, (std::map<std::size_t, int>{{11, 1}}));
    EXPECT_EQ(cause, "a worker process was ended by signal 9");
    EXPECT_EQ(taken.size(), Begins::items - 1);
    for (std::size_t item = 0; item < Begins::items; ++item)
      EXPECT_EQ(begins.of(item), item == 11 || item % 10 == 7 ? 2 : 1) << item;
  }
}

TEST(WorkerProcesses, ADeathEndsARunThatLosesNothing) {
  try {
    run_workers({.jobs = 2,
                 .work =
                     [](std::size_t item) {
                       if (item == 5) std::raise(SIGKILL);
                       return std::string();
                     },
                 .take = [](std::size_t, const std::string&) {}},
                Begins::items);
    ADD_FAILURE() << "it has returned";
  } catch (const std::runtime_error& error) {
    EXPECT_STREQ(error.what(), "a worker process was ended by signal 9");
  }
}

// All are killed with the parent, also one that was forked as it died, and none waits for room in its pipe.
TEST(WorkerProcesses, NoneOutlivesTheParent) {
  for (int i = 0; i < 5; ++i) {
    std::array<int, 2> lives{}, begun{};  // the first has an end as long as one of the processes lives
    ASSERT_EQ(::pipe(lives.data()), 0);
    ASSERT_EQ(::pipe(begun.data()), 0);
    const pid_t parent = ::fork();
    ASSERT_GE(parent, 0);
    if (parent == 0) {
      ::close(lives[0]);
      run_workers({.jobs = 60,
                   .work =
                       [&](std::size_t) {
                         static_cast<void>(::write(begun[1], "b", 1) == 1);
                         return std::string(100'000, 'x');
                       },
                   .take = [](std::size_t, const std::string&) {}},
                  1'000'000);
      ::_exit(0);
    }
    ::close(lives[1]);
    char any = 0;
    ASSERT_EQ(::read(begun[0], &any, 1), 1);
    ::kill(parent, SIGKILL);
    ASSERT_EQ(::waitpid(parent, nullptr, 0), parent);
    pollfd ended{lives[0], POLLIN, 0};
    constexpr int limit_ms = 60'000;
    EXPECT_EQ(::poll(&ended, 1, limit_ms), 1) << "a worker lives";
    for (const int file : {lives[0], begun[0], begun[1]}) ::close(file);
  }
}

}  // namespace
}  // namespace imud
