#pragma once

#include <cstdint>
#include <string_view>

#include "core/effects/triad_errors.hpp"
#include "core/effects/triad_step.hpp"
#include "core/numbers/correlated_noise.hpp"

namespace imud {

// Exponentially correlated noise b of standard deviation s and correlation time Tc (CorrelatedNoise):
//   error += b
// Its Allan variance is 2 s^2 Tc/tau (1 - Tc/(2 tau) (3 - 4 e^-x + e^-2x)), x = tau/Tc, which has its maximum, 0.617
// s as a deviation, at 1.89 Tc. The increment's error is its mean over the step (MeanOfStep), so that the increments
// are exact at any rate.
class ExponentiallyCorrelated {
 public:
  static constexpr std::string_view name = "exponentially correlated noise";
  static constexpr EffectTraits traits = {};
  ExponentiallyCorrelated(const TriadErrors& errors, Quantity quantity, double period_s)
      : noise_(errors.correlated_sigma, errors.correlation_time, period_s, quantity),
        within_step_(quantity, Process::correlated_within_step) {
    for (int i = 0; i < 3; ++i) {
      const MeanOfStep mean = mean_of_step(period_s / errors.correlation_time[i]);
      ends_[i] = mean.ends;
      within_[i] = mean.within * errors.correlated_sigma[i];
    }
  }
  bool is_on() const noexcept { return noise_.is_on(); }
  // The address of the step does not leave this function, so that the step need not be in memory where the effect is
  // off.
  void apply(TriadStep& step) noexcept {
    const Value value = next(step.normals, step.k);
    step.error += lanes(value.now);
    step.mean_error += lanes(value.mean);
  }
  void seek(const Normals& normals, std::uint64_t k) noexcept { noise_.seek(normals, k); }
  void power_on(std::uint64_t) noexcept {}
  void continue_from(const ExponentiallyCorrelated& before, const Normals& normals, std::uint64_t k) noexcept {
    noise_.continue_from(before.noise_, normals, k);
  }
  template <class Visit>
  void each_sequence(Visit visit) noexcept {
    noise_.each_sequence(visit);
    visit(within_step_);
  }

 private:
  struct Value {
    Vector3 now, mean;  // at the end of the step, and over it
  };
  [[gnu::noinline]] Value next(const Normals& normals, std::uint64_t k) noexcept {
    const Vector3 before = noise_.value(), now = noise_.next(normals, k);
    return {now, ends_.cwiseProduct(before + now) + within_.cwiseProduct(within_step_.at(normals, k))};
  }

  CorrelatedNoise noise_;
  NormalSequence within_step_;
  Vector3 ends_, within_;
};

}  // namespace imud
