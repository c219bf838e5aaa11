// Loops that do nothing but wait for the instants of a grid, as cyclictest does: what the machine itself allows.
//
//   plain_loops THREADS PERIOD_NS SHIFT_NS SECONDS
//
// Prints for each instant how late each thread has woken up, ns. The instants are multiples of the period of
// CLOCK_MONOTONIC, and SHIFT_NS later.
#include <pthread.h>
#include <sys/mman.h>
#include <time.h>

#include <cerrno>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <string>
#include <thread>
#include <vector>

namespace {

std::int64_t now_ns() {
  timespec now{};
  ::clock_gettime(CLOCK_MONOTONIC, &now);
  return std::int64_t{now.tv_sec} * 1'000'000'000 + now.tv_nsec;
}

void sleep_until(std::int64_t ns) {
  timespec time{};
  time.tv_sec = static_cast<time_t>(ns / 1'000'000'000);
  time.tv_nsec = static_cast<long>(ns % 1'000'000'000);
  while (::clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &time, nullptr) == EINTR) continue;
}

void run(std::size_t threads, std::int64_t period_ns, std::int64_t shift_ns, std::int64_t seconds) {
  const auto ticks = static_cast<std::size_t>(seconds * 1'000'000'000 / period_ns);
  const std::int64_t begin = (now_ns() / period_ns + 1'000'000'000 / period_ns) * period_ns + shift_ns;
  std::vector<std::vector<std::int64_t>> late(threads, std::vector<std::int64_t>(ticks));
  const bool is_locked = ::mlockall(MCL_CURRENT | MCL_FUTURE) == 0;
  bool has_priority = true;
  {
    std::vector<std::jthread> all;
    for (auto& mine : late) {
      all.emplace_back([&mine, begin, period_ns] {
        std::int64_t due = begin;
        for (std::int64_t& one : mine) {
          sleep_until(due);
          one = now_ns() - due;
          due += period_ns;
        }
      });
      sched_param priority{};
      priority.sched_priority = 70;  // imud's
      has_priority = ::pthread_setschedparam(all.back().native_handle(), SCHED_FIFO, &priority) == 0 && has_priority;
    }
  }
  if (!is_locked || !has_priority) std::fputs("plain_loops: without priority or locked memory\n", stderr);
  for (std::size_t tick = 0; tick < ticks; ++tick)
    for (std::size_t i = 0; i < threads; ++i)
      std::printf("%lld%c", static_cast<long long>(late[i][tick]), i + 1 < threads ? ' ' : '\n');
}

}  // namespace

int main(int argc, char** argv) {
  try {
    if (argc != 5) {
      std::fputs("usage: plain_loops THREADS PERIOD_NS SHIFT_NS SECONDS\n", stderr);
      return 2;
    }
    run(static_cast<std::size_t>(std::stoul(argv[1])), std::stoll(argv[2]), std::stoll(argv[3]), std::stoll(argv[4]));
    return 0;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "plain_loops: %s\n", error.what());
    return 2;
  }
}
