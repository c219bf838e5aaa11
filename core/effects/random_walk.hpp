#pragma once

#include <cmath>
#include <string_view>

#include "core/effects/triad_errors.hpp"
#include "core/effects/triad_step.hpp"

namespace imud {

// Rate random walk of gyros, acceleration random walk of accelerometers (IEEE Std 952-1997, C.1.3):
//   b <- b + K sqrt(T) n,  b = 0 in sample 0;  error += b at the end of the step
// Its Allan variance is K^2 tau/3. Given b at both ends of the step, its mean over the step is normal with mean
// (b1 + b2)/2 and variance K^2 T/12 (R. L. Farrenkopf, "Analytic Steady-State Accuracy Solutions for Two Common
// Spacecraft Attitude Estimators", J. Guidance and Control 1(4), 1978), so that the increments are exact at any rate.
class RandomWalk {
 public:
  static constexpr std::string_view name = "random walk";
  static constexpr EffectTraits traits = {};
  RandomWalk(const TriadErrors& errors, Quantity quantity, double period_s)
      : per_step_(errors.random_walk_density * std::sqrt(period_s)),
        on_(!errors.random_walk_density.isZero(0.0)),
        normals_(quantity, Process::random_walk),
        within_step_(quantity, Process::random_walk_within_step) {}
  bool is_on() const noexcept { return on_; }
  void apply(TriadStep& step) noexcept {
    constexpr double within = 0.28867513459481287;  // 1/sqrt(12)
    const Lanes before = lanes(b_);
    next(step.normals, step.k);
    const Lanes now = lanes(b_), random = lanes(within_step_.at(step.normals, step.k));
    step.error += now;
    step.mean_error += 0.5 * (before + now) + within * (lanes(per_step_) * random);
  }
  void seek(const Normals& normals, std::uint64_t k) noexcept {
    b_.setZero();
    if (!on_) return;
    for (std::uint64_t j = 0; j < k; ++j) next(normals, j);
  }
  void power_on(std::uint64_t) noexcept {}
  void continue_from(const RandomWalk& before, const Normals&, std::uint64_t) noexcept { b_ = before.b_; }
  template <class Visit>
  void each_sequence(Visit visit) noexcept {
    visit(normals_);
    visit(within_step_);
  }

 private:
  void next(const Normals& normals, std::uint64_t k) noexcept {
    if (k > 0) b_ += per_step_.cwiseProduct(normals_.at(normals, k));
  }

  Vector3 per_step_;
  bool on_;
  NormalSequence normals_, within_step_;
  Vector3 b_ = Vector3::Zero();
};

}  // namespace imud
