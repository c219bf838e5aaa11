#pragma once

#include <string_view>

#include "core/effects/triad_errors.hpp"
#include "core/effects/triad_step.hpp"

namespace imud {

// The response to the products of the specific force along two axes: K_ip, K_io and K_po in the model equation of an
// accelerometer (IEEE Std 1293-2018). f is the true specific force in platform axes:
//   error += C (f_y f_z, f_z f_x, f_x f_y)
// The mean error of a step is computed from the mean of f over the step, as in AccelerationSensitivity, which has the
// squares.
class CrossSensitivity : public StatelessEffect {
 public:
  static constexpr std::string_view name = "sensitivity to products of accelerations";
  static constexpr EffectTraits traits = {.is_rare = true, .is_constant = true};
  CrossSensitivity(const TriadErrors& errors, Quantity, double)
      : products_(errors.cross_sensitivity), on_(!errors.cross_sensitivity.isZero(0.0)) {}
  bool is_on() const noexcept { return on_; }
  void apply(TriadStep& step) const noexcept {
    step.error += lanes(response(step.specific_force));
    if (step.dt > 0.0) step.mean_error += lanes(response(step.delta_velocity / step.dt));
  }

 private:
  Vector3 response(const Vector3& f) const noexcept {
    return products_ * Vector3(f.y() * f.z(), f.z() * f.x(), f.x() * f.y());
  }

  Matrix3 products_;
  bool on_;
};

}  // namespace imud
