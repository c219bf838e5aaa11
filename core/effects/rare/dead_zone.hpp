#pragma once

#include <string_view>

#include "core/effects/triad_errors.hpp"
#include "core/effects/triad_step.hpp"

namespace imud {

// A motion about zero to which the sensor does not respond:
//   m <- m - clamp(m, -z, z)
// For an increment, m is its mean over the step.
class DeadZone : public StatelessEffect {
 public:
  static constexpr std::string_view name = "dead zone";
  static constexpr EffectTraits traits = {.is_rare = true};
  DeadZone(const TriadErrors& errors, Quantity, double)
      : half_width_(errors.dead_zone), on_(!errors.dead_zone.isZero(0.0)) {}
  bool is_on() const noexcept { return on_; }
  void apply(TriadStep& step) const noexcept {
    step.value -= lanes(lost(vector_of(step.value)));
    if (step.dt > 0.0) step.increment -= step.dt * lanes(lost(vector_of(step.increment / step.dt)));
  }

 private:
  Vector3 lost(const Vector3& m) const noexcept { return m.cwiseMax(-half_width_).cwiseMin(half_width_); }

  Vector3 half_width_;
  bool on_;
};

}  // namespace imud
