// Three clocks that cannot be mixed: truth time, host time, device time.
#pragma once

#include <chrono>
#include <compare>
#include <cstdint>

namespace imud {

using Nanoseconds = std::chrono::nanoseconds;

// One instant of the clock `Clock`, in ns since that clock's own epoch. Instants of different clocks neither
// compare nor subtract; two instants never add. Only durations (Nanoseconds) cross from one clock to another.
template <class Clock>
struct Instant {
  std::int64_t ns = 0;

  constexpr auto operator<=>(const Instant&) const = default;
  friend constexpr Instant operator+(Instant t, Nanoseconds d) { return {t.ns + d.count()}; }
  friend constexpr Instant operator-(Instant t, Nanoseconds d) { return {t.ns - d.count()}; }
  friend constexpr Nanoseconds operator-(Instant a, Instant b) { return Nanoseconds{a.ns - b.ns}; }
};

using TruthTime = Instant<struct TruthClock>;    // the simulator's own time
using HostTime = Instant<struct HostClock>;      // CLOCK_MONOTONIC, or a capture's time stamps
using DeviceTime = Instant<struct DeviceClock>;  // what the emulated sensor believes

constexpr double seconds(Nanoseconds d) { return static_cast<double>(d.count()) * 1e-9; }

// The instants k/rate after a start, exact for ever: computed from k, never summed, rounded to the nearest ns.
class Grid {
 public:
  static constexpr double min_rate_hz = 1e-3;
  static constexpr double max_rate_hz = 1e4;

  // rate_hz within these limits; resolved to 1 uHz.
  constexpr explicit Grid(double rate_hz) : rate_uhz_(static_cast<std::uint64_t>(rate_hz * 1e6 + 0.5)) {}

  // Time from the start to instant k, k < 1e13 (30 years at 10 kHz).
  constexpr Nanoseconds offset(std::uint64_t k) const {
    const std::uint64_t scaled = k * 1'000'000U;
    const std::uint64_t whole_s = scaled / rate_uhz_;
    const std::uint64_t rest = scaled % rate_uhz_;
    const std::uint64_t rest_ns = (rest * 1'000'000'000U + rate_uhz_ / 2) / rate_uhz_;
    return Nanoseconds{static_cast<std::int64_t>(whole_s * 1'000'000'000U + rest_ns)};
  }

 private:
  std::uint64_t rate_uhz_;
};

}  // namespace imud
