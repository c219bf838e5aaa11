#pragma once

#include <algorithm>
#include <cmath>
#include <string_view>

#include "core/effects/triad_errors.hpp"
#include "core/effects/triad_step.hpp"

namespace imud {

// The range of the sensor, per axis (memo Eq. 20-23). It acts last, so that an increment is that of the limited
// value.
class Saturation : public StatelessEffect {
 public:
  static constexpr std::string_view name = "saturation";
  Saturation(const TriadErrors& errors, Quantity, double) : max_(errors.max) {}
  static bool is_on() noexcept { return true; }
  void apply(TriadStep& step) const noexcept {
    const Vector3& m = step.value;
    if (std::abs(m[0]) <= max_ && std::abs(m[1]) <= max_ && std::abs(m[2]) <= max_) return;
    for (int i = 0; i < 3; ++i) {
      const double limited = std::clamp(step.value[i], -max_, max_);
      if (limited == step.value[i]) continue;
      step.saturated |= 1U << static_cast<unsigned>(i);
      step.value[i] = limited;
      step.increment[i] = limited * step.dt;
    }
  }

 private:
  double max_;
};

}  // namespace imud
