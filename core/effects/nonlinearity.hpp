#pragma once

#include <string_view>

#include "core/effects/triad_errors.hpp"
#include "core/effects/triad_step.hpp"

namespace imud {

// The deviation from the straight line (IEEE Std 952-1997, 3.2 and IEEE Std 1293-2018, the model equation's K2, K3):
//   m <- m + a/2 |m| + q m^2 + c m^3
// with a the asymmetry: positive values have the factor 1 + a/2, negative values 1 - a/2. For an
// increment, m is its mean over the step.
class Nonlinearity : public StatelessEffect {
 public:
  static constexpr std::string_view name = "asymmetry and nonlinearity";
  static constexpr EffectTraits traits = {.is_constant = true};
  Nonlinearity(const TriadErrors& errors, Quantity, double)
      : half_asymmetry_(0.5 * errors.scale_factor_asymmetry),
        quadratic_(errors.quadratic),
        cubic_(errors.cubic),
        on_(!half_asymmetry_.isZero(0.0) || !quadratic_.isZero(0.0) || !cubic_.isZero(0.0)) {}
  bool is_on() const noexcept { return on_; }
  void apply(TriadStep& step) const noexcept {
    step.value += deviation(step.value);
    if (step.dt > 0.0) step.increment += step.dt * deviation(step.increment / step.dt);
  }

 private:
  [[gnu::always_inline]] Lanes deviation(Lanes m) const noexcept {
    const Lanes square = m * m;
    return lanes(half_asymmetry_) * magnitude(m) + lanes(quadratic_) * square + lanes(cubic_) * (square * m);
  }

  Vector3 half_asymmetry_, quadratic_, cubic_;
  bool on_;
};

}  // namespace imud
