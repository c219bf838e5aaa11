#pragma once

#include <string_view>

#include "core/effects/triad_errors.hpp"
#include "core/effects/triad_step.hpp"

namespace imud {

// The scale factor's change with the temperature T of the sensor (IEEE Std 952-1997, 3.2, and IEEE Std 1293-2018,
// temperature coefficients), in degrees from the reference:
//   m <- m (1 + s1 (T - T0) + s2 (T - T0)^2 + s3 (T - T0)^3)
class TemperatureScale : public StatelessEffect {
 public:
  static constexpr std::string_view name = "scale factor by temperature";
  static constexpr EffectTraits traits = {.is_constant = true};
  TemperatureScale(const TriadErrors& errors, Quantity, double)
      : coefficients_(errors.temperature_scale),
        reference_c_(errors.reference_temperature_c),
        on_(!errors.temperature_scale.isZero(0.0)) {}
  bool is_on() const noexcept { return on_; }
  void apply(TriadStep& step) const noexcept {
    const double x = step.surroundings.temperature_c - reference_c_;
    const Lanes change = coefficients_ * Vector3(x, x * x, x * x * x);
    step.value += change * step.value;
    step.increment += change * step.increment;
  }

 private:
  LaneMatrix coefficients_;
  double reference_c_;
  bool on_;
};

}  // namespace imud
