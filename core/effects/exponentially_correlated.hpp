#pragma once

#include <string_view>

#include "core/effects/triad_errors.hpp"
#include "core/effects/triad_step.hpp"
#include "core/numbers/correlated_noise.hpp"

namespace imud {

// Exponentially correlated noise b of standard deviation s and correlation time Tc (CorrelatedNoise):
//   error += b
// Its Allan variance is 2 s^2 Tc/tau (1 - Tc/(2 tau) (3 - 4 e^-x + e^-2x)), x = tau/Tc, which has its maximum, 0.617
// s as a deviation, at 1.89 Tc. The increment's error is the mean of its values before and after the step.
class ExponentiallyCorrelated {
 public:
  static constexpr std::string_view name = "exponentially correlated noise";
  ExponentiallyCorrelated(const TriadErrors& errors, Quantity quantity, double period_s)
      : noise_(errors.correlated_sigma, errors.correlation_time, period_s, quantity) {}
  bool is_on() const noexcept { return noise_.is_on(); }
  void apply(TriadStep& step) noexcept {
    const Vector3 before = noise_.value();
    step.error += noise_.next(step.normals, step.k);
    step.mean_error += 0.5 * (before + noise_.value());
  }
  void seek(const Normals& normals, std::uint64_t k) noexcept { noise_.seek(normals, k); }
  void power_on(std::uint64_t) noexcept {}
  void continue_from(const ExponentiallyCorrelated& before, const Normals& normals, std::uint64_t k) noexcept {
    noise_.continue_from(before.noise_, normals, k);
  }
  void forget_numbers() noexcept { noise_.forget_numbers(); }

 private:
  CorrelatedNoise noise_;
};

}  // namespace imud
