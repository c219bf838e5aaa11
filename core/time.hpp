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
struct TimePoint {
  std::int64_t ns = 0;

  constexpr auto operator<=>(const TimePoint&) const = default;
  friend constexpr TimePoint operator+(TimePoint t, Nanoseconds d) { return {t.ns + d.count()}; }
  friend constexpr TimePoint operator-(TimePoint t, Nanoseconds d) { return {t.ns - d.count()}; }
  friend constexpr Nanoseconds operator-(TimePoint a, TimePoint b) { return Nanoseconds{a.ns - b.ns}; }
};

using TruthTime = TimePoint<struct OfTruth>;    // the simulator's own time
using HostTime = TimePoint<struct OfHost>;      // CLOCK_MONOTONIC, or a capture's time stamps
using DeviceTime = TimePoint<struct OfDevice>;  // what the emulated sensor believes

constexpr double seconds(Nanoseconds d) { return static_cast<double>(d.count()) * 1e-9; }
// To the nearest; within +-292 years.
constexpr Nanoseconds nanoseconds(double seconds) {
  return Nanoseconds{static_cast<std::int64_t>(1e9 * seconds + (seconds < 0 ? -0.5 : 0.5))};
}

// The instants phase + k/rate after a start, exact for ever: computed from k, never summed, rounded to the nearest
// ns.
class Grid {
 public:
  static constexpr double min_rate_hz = 1e-3;
  static constexpr double max_rate_hz = 1e4;
  static constexpr double max_clock_error_ppm = 1e5;

  // rate_hz within these limits, resolved to 1 uHz. `clock_error_ppm`, resolved to 1e-3, within +-max: how much
  // faster than nominal the clock runs that makes the instants. `phase` not negative.
  constexpr explicit Grid(double rate_hz, double clock_error_ppm = 0.0, Nanoseconds phase = {})
      : rate_uhz_(static_cast<std::uint64_t>(rate_hz * 1e6 + 0.5)),
        clock_rate_(1'000'000'000U + static_cast<std::uint64_t>(static_cast<std::int64_t>(
                                         clock_error_ppm * 1e3 + (clock_error_ppm < 0 ? -0.5 : 0.5)))),
        phase_(phase) {}

  // Time from the start to instant k, k < 1e13 (30 years at 10 kHz).
  constexpr Nanoseconds offset(std::uint64_t k) const { return phase_ + steps(k, clock_rate_); }
  // The same as the clock itself counts it: without its error.
  constexpr Nanoseconds nominal_offset(std::uint64_t k) const { return phase_ + steps(k, 1'000'000'000U); }

  // Mean time between two instants, rounded.
  constexpr Nanoseconds period() const { return steps(1, clock_rate_); }

 private:
  __extension__ using Wide = unsigned __int128;

  // `clock_rate`: ns that the clock counts in a true second.
  constexpr Nanoseconds steps(std::uint64_t k, std::uint64_t clock_rate) const {
    const std::uint64_t divisor = rate_uhz_ * clock_rate;  // below 2^64: 1e10 times 1.1e9
    const Wide scaled = Wide{k} * 1'000'000'000'000'000U * 1'000'000'000U;
    return Nanoseconds{static_cast<std::int64_t>((scaled + divisor / 2) / divisor)};
  }

  std::uint64_t rate_uhz_;
  std::uint64_t clock_rate_;
  Nanoseconds phase_;
};

}  // namespace imud
