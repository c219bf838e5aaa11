// Workers that die: without anyone to lose an item to they end the run, else the open item alone is done again.
#include "emulator/seeds/worker_processes.hpp"

#include <gtest/gtest.h>
#include <sys/mman.h>

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

}  // namespace
}  // namespace imud
