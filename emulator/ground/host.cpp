#include "emulator/ground/host.hpp"

#include <sys/prctl.h>
#include <time.h>

#include <algorithm>

#include "transports/host_clock.hpp"

namespace imud {
namespace {
timespec to_timespec(std::int64_t ns) { return {ns / 1'000'000'000, ns % 1'000'000'000}; }
}  // namespace

MonotonicHost::MonotonicHost() noexcept { ::prctl(PR_SET_TIMERSLACK, 1UL, 0UL, 0UL, 0UL); }

HostTime MonotonicHost::now() noexcept { return host_now(); }

HostTime MonotonicHost::sleep_until(HostTime time, Nanoseconds spin) noexcept {
  const timespec at = to_timespec((time - spin).ns);
  ::clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &at, nullptr);
  HostTime now = host_now();
  if (spin.count() > 0)
    while (now < time) now = host_now();
  return now;
}

bool MonotonicHost::wait_for_input(std::span<pollfd> inputs, HostTime time) noexcept {
  const timespec at_most = to_timespec(std::max(time - host_now(), Nanoseconds{0}).count());
  return ::ppoll(inputs.data(), inputs.size(), &at_most, nullptr) > 0;
}

}  // namespace imud
