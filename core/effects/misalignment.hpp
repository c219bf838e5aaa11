#pragma once

#include <string_view>

#include "core/effects/triad_errors.hpp"
#include "core/effects/triad_step.hpp"

namespace imud {

// Input axes that are neither the platform's nor orthogonal (IEEE Std 1559, misalignment and nonorthogonality):
//   m <- M m
class Misalignment : public StatelessEffect {
 public:
  static constexpr std::string_view name = "misalignment";
  static constexpr EffectTraits traits = {.is_constant = true};
  Misalignment(const TriadErrors& errors, Quantity, double)
      : matrix_(errors.misalignment), on_(!errors.misalignment.isIdentity(0.0)) {}
  bool is_on() const noexcept { return on_; }
  void apply(TriadStep& step) const noexcept {
    step.value = matrix_ * step.value;
    step.increment = matrix_ * step.increment;
  }

 private:
  LaneMatrix matrix_;
  bool on_;
};

}  // namespace imud
