#pragma once

#include <cmath>
#include <string_view>

#include "core/effects/triad_errors.hpp"
#include "core/effects/triad_step.hpp"

namespace imud {

// White noise: the angle random walk of gyros, the velocity random walk of accelerometers (IEEE Std 952-1997, C.1.1).
//   error += N/sqrt(T) n,  n ~ N(0, I),  T the sample period
// Its two-sided spectral density is N^2, its Allan variance N^2/tau.
class WhiteNoise : public StatelessEffect {
 public:
  static constexpr std::string_view name = "white noise";
  static constexpr EffectTraits traits = {};
  WhiteNoise(const TriadErrors& errors, Quantity quantity, double period_s)
      : sigma_(errors.white_density / std::sqrt(period_s)),
        on_(!errors.white_density.isZero(0.0)),
        normals_(quantity, Process::white_noise) {}
  bool is_on() const noexcept { return on_; }
  void apply(TriadStep& step) noexcept {
    step.constant_error += lanes(sigma_) * lanes(normals_.at(step.normals, step.k));
  }
  template <class Visit>
  void each_sequence(Visit visit) noexcept {
    visit(normals_);
  }

 private:
  Vector3 sigma_;
  bool on_;
  NormalSequence normals_;
};

}  // namespace imud
