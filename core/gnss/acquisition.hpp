// Acquisition: the time that a GNSS receiver searches before its first fix, and after an outage.
#pragma once

#include <cstdint>

#include "core/gnss/sky.hpp"
#include "core/sample.hpp"

namespace imud {

// A receiver has a fix once its satellites have been in view for a constant time without a break:
// GnssModel::first_fix_s since power on, and reacquire_s after that. Counts samples. Nothing here allocates, locks or
// throws; not thread-safe.
class Acquisition {
 public:
  // `rate_hz` is the rate of the samples, above 0.
  Acquisition(const GnssModel& model, double rate_hz) noexcept
      : first_(samples(model.first_fix_s, rate_hz)), again_(samples(model.reacquire_s, rate_hz)) {}

  bool is_on() const noexcept { return (first_ | again_) != 0; }
  // The receiver has no fix, and searches as after power on.
  void power_on() noexcept {
    in_view_ = 0;
    has_had_fix_ = false;
  }
  // Takes the fix that is possible at the next sample, and removes it while the receiver searches.
  void take(Navigation& fix) noexcept {
    if (!fix.is_known) {
      in_view_ = 0;
      return;
    }
    if (in_view_ < (has_had_fix_ ? again_ : first_)) {
      ++in_view_;
      fix = {};
      return;
    }
    has_had_fix_ = true;
    in_view_ = again_;
  }
  // Takes over the state of `before`, which may have other search times. `is_fixed`: the last sample had a fix;
  // `before` does not know of this fix if it was not on (is_on()).
  void continue_from(const Acquisition& before, bool is_fixed) noexcept {
    has_had_fix_ = before.has_had_fix_ || is_fixed;
    in_view_ = is_fixed ? again_ : before.in_view_;
  }

 private:
  static std::uint64_t samples(double time_s, double rate_hz) noexcept {
    return static_cast<std::uint64_t>(time_s * rate_hz + 0.5);
  }

  std::uint64_t first_, again_;  // samples
  std::uint64_t in_view_ = 0;    // samples for which the satellites have been in view, up to the time that is needed
  bool has_had_fix_ = false;     // since power on
};

}  // namespace imud
