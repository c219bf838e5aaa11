// TruthStamps: maps the time of a clock that hosts share to the simulator's time, by the stamps of truths.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "core/time.hpp"
#include "core/truth.hpp"

namespace imud {

// Between the stamps of two truths the simulator's time is linear, before the first and after the last it passes as
// the clock's. In integers: stamps that rise as simulation time does give the same time on every host, to the
// nanosecond, whichever truths a host has. No allocation. One thread.
class TruthStamps {
 public:
  // `clock`: the clock whose stamps are used; with SharedClock::none no stamps are used.
  explicit TruthStamps(SharedClock clock) noexcept : clock_(clock) {}

  enum class Result : std::uint8_t {
    used,
    none,         // the truth has no stamp, or no stamps are used
    other_clock,  // refused: the stamp is of another clock
    far,        // refused: the stamp is more than `farthest` from the arrival, or `longest_hold_up` before it if the
                // difference of stamp and simulation time is as in the stamp before
    not_later,  // refused: the stamp is not later than the stamp before, although the simulation time is later
  };
  // Takes the stamp of the truth of `time`, which is later than in the truths before, and arrived at `arrival` by the
  // clock. Forgets all stamps unless the result is `used` or `not_later`. `shift`: how much longer than the
  // simulation time the clock's time since the stamp before is, a pause; or negative, a leap. 0 without a stamp
  // before.
  struct Taken {
    Result result = Result::none;
    Nanoseconds shift{0};
  };
  Taken take(TruthTime time, const ClockStamp& stamp, SharedTime arrival) noexcept;
  void clear() noexcept { count_ = 0; }

  bool is_empty() const noexcept { return count_ == 0; }
  // Returns the simulator's time at `time`. It never decreases with `time`. Must not be called if is_empty().
  TruthTime truth(SharedTime time) const noexcept;

  static constexpr Nanoseconds farthest = std::chrono::seconds(1), longest_hold_up = std::chrono::seconds(10);

 private:
  struct Knot {
    TruthTime truth;
    SharedTime stamp;
    Nanoseconds difference() const noexcept { return Nanoseconds{stamp.ns - truth.ns}; }
  };
  const Knot& knot(std::size_t i) const noexcept { return knots_[(first_ + i) % knots_.size()]; }

  const SharedClock clock_;
  // Knots between which the difference does not change are left out.
  std::array<Knot, 1024> knots_;
  std::size_t first_ = 0;
  std::size_t count_ = 0;
};

}  // namespace imud
