#pragma once

#include <string_view>

#include "core/effects/triad_errors.hpp"
#include "core/effects/triad_step.hpp"

namespace imud {

// The bias' change with the temperature T of the sensor, in degrees from the reference (as TemperatureScale):
//   error += b1 (T - T0) + b2 (T - T0)^2 + b3 (T - T0)^3
class TemperatureBias : public StatelessEffect {
 public:
  static constexpr std::string_view name = "bias by temperature";
  static constexpr EffectTraits traits = {.is_constant = true};
  TemperatureBias(const TriadErrors& errors, Quantity, double)
      : coefficients_(errors.temperature_bias),
        reference_c_(errors.reference_temperature_c),
        on_(!errors.temperature_bias.isZero(0.0)) {}
  bool is_on() const noexcept { return on_; }
  void apply(TriadStep& step) const noexcept {
    const double x = step.surroundings.temperature_c - reference_c_;
    step.constant_error += coefficients_ * Vector3(x, x * x, x * x * x);
  }

 private:
  LaneMatrix coefficients_;
  double reference_c_;
  bool on_;
};

}  // namespace imud
