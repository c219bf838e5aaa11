#pragma once

#include <cmath>
#include <string_view>

#include "core/effects/triad_errors.hpp"
#include "core/effects/triad_step.hpp"
#include "core/numbers/round_to.hpp"

namespace imud {

// The digits of the increments. Sensors that count pulses or transmit sums keep the remainder for the next increment:
// the sum of all increments differs from the true sum by half an LSB at most.
//   d <- lsb round((d + remainder)/lsb)
// This is quantization noise of the angle or velocity, Q = lsb/sqrt(12) (IEEE Std 952-1997, C.1.6), with the Allan
// variance 3 Q^2/tau^2.
class IncrementRounding : public StatelessEffect {
 public:
  static constexpr std::string_view name = "rounding of the increments";
  static constexpr EffectTraits traits = {};
  IncrementRounding(const TriadErrors& errors, Quantity, double) : lsb_(errors.increment_lsb) {}
  bool is_on() const noexcept { return lsb_ > 0.0; }
  void apply(TriadStep& step) noexcept {
    if (step.dt == 0.0) return;  // no increment
    for (int i = 0; i < 3; ++i) {
      const double exact = step.increment[i] + remainder_[i];
      // An infinite or huge increment has no digits to round, and leaves no remainder.
      const bool is_countable = std::abs(exact / lsb_) < 0x1p52;
      const double rounded = is_countable ? round_to(exact, lsb_) : exact;
      remainder_[i] = is_countable ? exact - rounded : 0.0;
      step.increment[i] = rounded;
    }
  }
  void continue_from(const IncrementRounding& before, const Normals&, std::uint64_t) noexcept {
    remainder_ = before.remainder_;
  }

 private:
  double lsb_;
  Vector3 remainder_ = Vector3::Zero();  // seek() cannot restore it
};

}  // namespace imud
