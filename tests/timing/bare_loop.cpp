#include "tests/timing/bare_loop.hpp"

#include <fmt/format.h>
#include <pthread.h>
#include <sched.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <thread>

#include "transports/host_clock.hpp"

namespace imud::timing {

namespace {

double thread_cpu_s() {
  timespec used{};
  ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &used);
  return static_cast<double>(used.tv_sec) + 1e-9 * static_cast<double>(used.tv_nsec);
}

}  // namespace

BareRun bare_loop(const Folder& folder, int ptys, bool are_apart, double duration_s) {
  constexpr Nanoseconds period = std::chrono::milliseconds(1);
  std::vector<std::string> links;
  std::vector<FileDescriptor> masters, kept_open;
  for (int i = 0; i < ptys; ++i) {
    links.push_back(folder / fmt::format("bare{}", i));
    masters.push_back(open_pty(links.back()));
    kept_open.push_back(open_link(links.back()));
  }
  std::vector<std::vector<double>> late_us(masters.size());
  for (std::vector<double>& one : late_us) one.reserve(static_cast<std::size_t>(1100 * duration_s));
  BareRun run;
  {
    const PtyReaders readers(links);
    std::this_thread::sleep_for(std::chrono::milliseconds(50));  // until they have begun
    std::jthread loop([&] {
      // imud and cyclictest have this priority, too. Without the right to it none of the three has it.
      const sched_param priority{70};
      ::pthread_setschedparam(::pthread_self(), SCHED_FIFO, &priority);
      const double before_s = thread_cpu_s();
      const std::array<std::byte, frame_size> frame{};
      const auto steps = static_cast<std::int64_t>(1000 * duration_s);
      const HostTime first = host_now() + period;
      for (std::int64_t k = 0; k < steps; ++k)
        for (std::size_t i = 0; i < masters.size(); ++i) {
          const Nanoseconds phase = are_apart ? period * static_cast<int>(i) / ptys : Nanoseconds{0};
          const HostTime due = first + k * period + phase;
          if (are_apart || i == 0) sleep_until(due);
          late_us[i].push_back(1e6 * seconds(host_now() - due));
          [[maybe_unused]] const auto n = ::write(masters[i].get(), frame.data(), frame.size());
        }
      run.cpu_s = thread_cpu_s() - before_s;
    });
  }
  for (const std::string& link : links) std::filesystem::remove(link);
  for (std::vector<double>& late : late_us) {
    run.lateness.p50 = std::max(run.lateness.p50, percentile(late, 50));
    run.lateness.p99 = std::max(run.lateness.p99, percentile(late, 99));
    run.lateness.p999 = std::max(run.lateness.p999, percentile(late, 99.9));
    run.lateness.max = std::max(run.lateness.max, percentile(late, 100));
  }
  return run;
}

}  // namespace imud::timing
