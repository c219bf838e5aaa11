#pragma once

#include <string_view>

#include "core/effects/triad_errors.hpp"
#include "core/effects/triad_step.hpp"

namespace imud {

// Adds the additive errors to the value, and their integral to the increment (memo Eq. 15-18).
class AddErrors : public StatelessEffect {
 public:
  static constexpr std::string_view name = "sum of the errors";
  static constexpr EffectTraits traits = {.is_of_memo = true};
  AddErrors(const TriadErrors&, Quantity, double) {}
  static bool is_on() noexcept { return true; }
  static void apply(TriadStep& step) noexcept {
    step.value += step.constant_error + step.error;
    step.increment += step.dt * (step.constant_error + step.mean_error);
  }
};

}  // namespace imud
