#pragma once

#include <algorithm>
#include <string_view>

#include "core/effects/triad_errors.hpp"
#include "core/effects/triad_step.hpp"

namespace imud {

// Limits an axis of `value` to the range, and the increment over `dt` with it. Returns true if the value was not
// within the range. NaN is within no range: the value stays NaN, and so becomes the increment.
inline bool limit_axis(const AxisLimits& range, int axis, double dt, Vector3& value, Vector3& increment) noexcept {
  const double limited = std::clamp(value[axis], range.lower[axis], range.upper[axis]);
  if (limited == value[axis]) return false;
  value[axis] = limited;
  increment[axis] = limited * dt;
  return true;
}

// The range of the sensor, per axis and direction (memo Eq. 20-23). It acts last, so that increments
// belong to limited values.
class Saturation : public StatelessEffect {
 public:
  static constexpr std::string_view name = "saturation";
  static constexpr EffectTraits traits = {.is_of_memo = true};
  Saturation(const TriadErrors& errors, Quantity, double)
      : limits_(errors.range()), free_(std::min(limits_.upper.minCoeff(), (-limits_.lower).minCoeff())) {}
  static bool is_on() noexcept { return true; }
  void apply(TriadStep& step) const noexcept {
    const Lanes m = magnitude(step.value);
    if (m[0] <= free_ && m[1] <= free_ && m[2] <= free_) return;
    Vector3 value = vector_of(step.value), increment = vector_of(step.increment);
    for (int i = 0; i < 3; ++i)
      if (limit_axis(limits_, i, step.dt, value, increment)) step.saturated |= 1U << static_cast<unsigned>(i);
    step.value = lanes(value);
    step.increment = lanes(increment);
  }

 private:
  AxisLimits limits_;
  double free_;  // no axis has a limit within +-free_
};

}  // namespace imud
