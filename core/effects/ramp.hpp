#pragma once

#include <string_view>

#include "core/effects/triad_errors.hpp"
#include "core/effects/triad_step.hpp"

namespace imud {

// A drift in proportion to the time t since power on (IEEE Std 952-1997, C.1.4, rate ramp):
//   error += R t;  its Allan variance is R^2 tau^2/2
class Ramp : public StatelessEffect {
 public:
  static constexpr std::string_view name = "ramp";
  static constexpr EffectTraits traits = {};
  Ramp(const TriadErrors& errors, Quantity, double) : slope_(errors.ramp), on_(!errors.ramp.isZero(0.0)) {}
  bool is_on() const noexcept { return on_; }
  void apply(TriadStep& step) const noexcept {
    const Lanes slope = lanes(slope_);
    step.error += step.since_power_on * slope;
    step.mean_error += (step.since_power_on - 0.5 * step.dt) * slope;
  }

 private:
  Vector3 slope_;
  bool on_;
};

}  // namespace imud
