// Three clocks that cannot be mixed: truth time, host time, device time.
#pragma once

#include <chrono>
#include <compare>
#include <cstdint>

namespace imud {

using Nanoseconds = std::chrono::nanoseconds;

// An instant of the clock `Clock`, in ns since that clock's own epoch. Instants of different clocks cannot be
// compared or subtracted, and instants cannot be added: such code does not compile. Only durations (Nanoseconds) pass
// from one clock to another. Overflow beyond +-292 years is not checked.
template <class Clock>
struct TimePoint {
  std::int64_t ns = 0;

  constexpr auto operator<=>(const TimePoint&) const = default;
  friend constexpr TimePoint operator+(TimePoint t, Nanoseconds d) { return {t.ns + d.count()}; }
  friend constexpr TimePoint operator-(TimePoint t, Nanoseconds d) { return {t.ns - d.count()}; }
  friend constexpr Nanoseconds operator-(TimePoint a, TimePoint b) { return Nanoseconds{a.ns - b.ns}; }
};

using TruthTime = TimePoint<struct OfTruth>;    // the simulator's time
using HostTime = TimePoint<struct OfHost>;      // CLOCK_MONOTONIC, or the time stamps of a capture
using DeviceTime = TimePoint<struct OfDevice>;  // the clock of the emulated sensor

// A clock that hosts share: CLOCK_TAI, CLOCK_REALTIME, or CLOCK_MONOTONIC for the processes of one host.
enum class SharedClock : std::uint8_t { none, tai, utc, monotonic };
using SharedTime = TimePoint<struct OfShared>;  // the time of such a clock

// Converts to s, rounded to a double.
constexpr double seconds(Nanoseconds d) { return static_cast<double>(d.count()) * 1e-9; }
// Converts s, within +-292 years, to the nearest ns.
constexpr Nanoseconds nanoseconds(double seconds) {
  return Nanoseconds{static_cast<std::int64_t>(1e9 * seconds + (seconds < 0 ? -0.5 : 0.5))};
}

// The instants phase + k/rate after a start, each computed from k and rounded to the nearest ns, so that they never
// drift. Immutable; nothing here throws.
class Grid {
 public:
  static constexpr double min_rate_hz = 1e-3;
  static constexpr double max_rate_hz = 1e4;
  static constexpr double max_clock_error_ppm = 1e5;

  // `rate_hz` is within the limits above and resolved to 1 uHz. `clock_error_ppm` is the relative error of the clock
  // that makes the instants, positive if it runs fast, within +-max_clock_error_ppm and resolved to 1e-3. `phase` is
  // not negative.
  constexpr explicit Grid(double rate_hz, double clock_error_ppm = 0.0, Nanoseconds phase = {})
      : rate_uhz_(static_cast<std::uint64_t>(rate_hz * 1e6 + 0.5)),
        clock_rate_(1'000'000'000U + static_cast<std::uint64_t>(static_cast<std::int64_t>(
                                         clock_error_ppm * 1e3 + (clock_error_ppm < 0 ? -0.5 : 0.5)))),
        phase_(phase) {}

  // Returns the true time from the start to instant k, for every instant within 292 years (k up to 9.2e13 at 10 kHz).
  constexpr Nanoseconds offset(std::uint64_t k) const { return phase_ + steps(k, clock_rate_); }
  // Returns the same time as the clock counts it: nominal, without the clock's error.
  constexpr Nanoseconds nominal_offset(std::uint64_t k) const { return phase_ + steps(k, 1'000'000'000U); }

  // The first returns the time that the clock counts in the true time `elapsed`, the second the true time in which
  // the clock counts `counted`. Both are valid within +-9 years and rounded to the nearest ns.
  constexpr Nanoseconds counted(Nanoseconds elapsed) const { return scaled(elapsed, clock_rate_, 1'000'000'000U); }
  constexpr Nanoseconds elapsed(Nanoseconds counted) const { return scaled(counted, 1'000'000'000U, clock_rate_); }

  // The instants one after another, the same as offset() or nominal_offset() returns, without their division.
  class Walk {
   public:
    // Stands at instant `k`.
    constexpr Walk(const Grid& grid, std::uint64_t k, bool is_nominal = false)
        : divisor_(grid.rate_uhz_ * (is_nominal ? 1'000'000'000U : grid.clock_rate_)), k_(k) {
      const Wide scaled = k * scale + divisor_ / 2;
      offset_ = grid.phase_ + Nanoseconds{static_cast<std::int64_t>(scaled / divisor_)};
      remainder_ = static_cast<std::uint64_t>(scaled % divisor_);
      step_ = Nanoseconds{static_cast<std::int64_t>(scale / divisor_)};
      step_remainder_ = static_cast<std::uint64_t>(scale % divisor_);
    }
    constexpr std::uint64_t k() const { return k_; }
    constexpr Nanoseconds offset() const { return offset_; }
    constexpr void advance() {
      ++k_;
      offset_ += step_;
      const std::uint64_t room = divisor_ - step_remainder_;
      const bool is_whole = remainder_ >= room;
      offset_ += Nanoseconds{is_whole ? 1 : 0};
      remainder_ = is_whole ? remainder_ - room : remainder_ + step_remainder_;
    }

   private:
    std::uint64_t divisor_, k_;
    Nanoseconds offset_, step_;
    std::uint64_t remainder_, step_remainder_;
  };

  // Returns the time from the start to instant 0.
  constexpr Nanoseconds phase() const { return phase_; }
  // Returns the mean time between two instants, rounded to the nearest ns.
  constexpr Nanoseconds period() const { return steps(1, clock_rate_); }
  // Return the mean time between two instants in true time, s, and as the clock counts it, s.
  constexpr double period_s() const { return 1e9 * nominal_period_s() / static_cast<double>(clock_rate_); }
  constexpr double nominal_period_s() const { return 1e6 / static_cast<double>(rate_uhz_); }

 private:
  __extension__ using Wide = unsigned __int128;
  static constexpr Wide scale = Wide{1'000'000'000'000'000U} * 1'000'000'000U;  // ns * uHz * ns per second

  // Returns the time of k periods. `clock_rate` is the number of ns that the clock counts in a true second.
  constexpr Nanoseconds steps(std::uint64_t k, std::uint64_t clock_rate) const {
    const std::uint64_t divisor = rate_uhz_ * clock_rate;  // below 2^64: 1e10 times 1.1e9
    return Nanoseconds{static_cast<std::int64_t>((k * scale + divisor / 2) / divisor)};
  }

  // Returns `time` * numerator / denominator, rounded to the nearest ns.
  static constexpr Nanoseconds scaled(Nanoseconds time, std::uint64_t numerator, std::uint64_t denominator) {
    const bool negative = time.count() < 0;
    const auto magnitude = static_cast<std::uint64_t>(negative ? -time.count() : time.count());
    const auto result = static_cast<std::int64_t>((Wide{magnitude} * numerator + denominator / 2) / denominator);
    return Nanoseconds{negative ? -result : result};
  }

  std::uint64_t rate_uhz_;
  std::uint64_t clock_rate_;
  Nanoseconds phase_;
};

}  // namespace imud
