#pragma once

#include <string_view>

#include "core/effects/triad_errors.hpp"
#include "core/effects/triad_step.hpp"

namespace imud {

// The factor from input to output:  m <- k m.
class ScaleFactor : public StatelessEffect {
 public:
  static constexpr std::string_view name = "scale factor";
  static constexpr EffectTraits traits = {.is_of_memo = true, .is_constant = true};
  ScaleFactor(const TriadErrors& errors, Quantity, double) : factor_(errors.scale_factor) {}
  static bool is_on() noexcept { return true; }
  void apply(TriadStep& step) const noexcept {
    const Lanes factor = lanes(factor_);
    step.value = factor * step.value;
    step.increment = factor * step.increment;
  }

 private:
  Vector3 factor_;
};

}  // namespace imud
