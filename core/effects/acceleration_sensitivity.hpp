#pragma once

#include <string_view>

#include "core/effects/triad_errors.hpp"
#include "core/effects/triad_step.hpp"

namespace imud {

// The response of a gyro to acceleration (IEEE Std 952-1997, 3.2, g-sensitivity), or of an accelerometer to
// acceleration along its other axes. f is the true specific force in platform axes:
//   error += G f + H (f_x^2, f_y^2, f_z^2)
// The mean error of a step is computed from the mean of f over the step: the course of f within the step is
// neglected.
class AccelerationSensitivity : public StatelessEffect {
 public:
  static constexpr std::string_view name = "acceleration sensitivity";
  static constexpr EffectTraits traits = {.is_constant = true};
  AccelerationSensitivity(const TriadErrors& errors, Quantity, double)
      : linear_(errors.g_sensitivity),
        square_(errors.g_squared_sensitivity),
        on_(!errors.g_sensitivity.isZero(0.0) || !errors.g_squared_sensitivity.isZero(0.0)) {}
  bool is_on() const noexcept { return on_; }
  void apply(TriadStep& step) const noexcept {
    step.error += response(lanes(step.specific_force));
    if (step.dt > 0.0) step.mean_error += response(lanes(step.delta_velocity) / step.dt);
  }

 private:
  [[gnu::always_inline]] Lanes response(Lanes f) const noexcept { return linear_ * f + square_ * (f * f); }

  LaneMatrix linear_, square_;
  bool on_;
};

}  // namespace imud
