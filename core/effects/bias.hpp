#pragma once

#include <string_view>

#include "core/effects/triad_errors.hpp"
#include "core/effects/triad_step.hpp"

namespace imud {

//   error += b                                                                            (memo Eq. 15, 16)
class Bias : public StatelessEffect {
 public:
  static constexpr std::string_view name = "bias";
  static constexpr EffectTraits traits = {.is_of_memo = true, .is_constant = true};
  Bias(const TriadErrors& errors, Quantity, double) : bias_(errors.bias) {}
  static bool is_on() noexcept { return true; }
  // Replaces b from the next sample on.
  void set(const Vector3& bias) noexcept { bias_ = bias; }
  void apply(TriadStep& step) const noexcept { step.constant_error += lanes(bias_); }

 private:
  Vector3 bias_;
};

}  // namespace imud
