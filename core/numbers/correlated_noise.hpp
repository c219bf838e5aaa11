// CorrelatedNoise: exponentially correlated (Markov) noise on three axes, which drifts of many kinds are.
#pragma once

#include <cmath>
#include <cstdint>

#include "core/numbers/elementary.hpp"
#include "core/numbers/random.hpp"
#include "core/vector.hpp"

namespace imud {

// Given exponentially correlated noise of standard deviation 1 at both ends of a step of x = T/Tc, its mean over the
// step is normal, with the mean `ends` (b1 + b2) and the standard deviation `within`:
//   ends = tanh(x/2)/x,  within = sqrt(2 (x - 2 tanh(x/2)))/x
// (of the bridge between two values of an Ornstein-Uhlenbeck process, whose covariance is sinh u sinh(x - v)/sinh x).
struct MeanOfStep {
  double ends, within;
};
inline MeanOfStep mean_of_step(double x) noexcept {
  if (x < 0.1) {  // the difference would cancel
    const double square = x * x;
    return {0.5 - square * (1.0 / 24 - square / 240),
            std::sqrt(x * (1.0 / 6 - square * (1.0 / 60 - square * (17.0 / 10080))))};
  }
  const double decayed = elementary::exp(-x), half_tanh = (1 - decayed) / (1 + decayed);
  return {half_tanh / x, std::sqrt(2 * (x - 2 * half_tanh)) / x};
}

// Stationary from the first sample (IEEE Std 952-1997, C.1.5), with samples of period T:
//   b <- a b + s sqrt(1 - a^2) n,  a = exp(-T/Tc),  n ~ N(0, I);  b = s n in sample 0
// Does not allocate, lock or throw; not thread-safe.
class CorrelatedNoise {
 public:
  // `sigma` is s, in the unit of b, not negative; `time_s` is Tc, above 0. Each quantity has one such noise.
  CorrelatedNoise(const Vector3& sigma, const Vector3& time_s, double period_s, Quantity quantity) noexcept
      : sigma_(sigma), on_(!sigma.isZero(0.0)), normals_(quantity, Process::exponentially_correlated) {
    for (int i = 0; i < 3; ++i) {
      transition_[i] = elementary::exp(-period_s / time_s[i]);
      driving_[i] = sigma_[i] * std::sqrt(1.0 - transition_[i] * transition_[i]);
    }
  }
  bool is_on() const noexcept { return on_; }
  // Returns b of sample k, valid until the next call. The last call must have been next(k - 1) or seek(k), unless k
  // is 0.
  const Vector3& next(const Normals& normals, std::uint64_t k) noexcept {
    const Vector3 n = normals_.at(normals, k);
    if (k == 0)
      b_ = sigma_.cwiseProduct(n);
    else
      b_ = transition_.cwiseProduct(b_) + driving_.cwiseProduct(n);
    return b_;
  }
  // Returns the last value of next(); 0 before the first.
  const Vector3& value() const noexcept { return b_; }
  // Makes next(k) return the value that sample k has in the sequence from sample 0. The run time is proportional to
  // k.
  void seek(const Normals& normals, std::uint64_t k) noexcept {
    if (!on_) return;
    for (std::uint64_t j = 0; j < k; ++j) next(normals, j);
  }
  // Makes next(k) continue from the b of `before`, whose last call must have been for sample k - 1. b is scaled by
  // the ratio of the standard deviations, so that the noise is stationary. An axis that had no noise begins with s n.
  void continue_from(const CorrelatedNoise& before, const Normals& normals, std::uint64_t k) noexcept {
    if (!on_ || k == 0) return;
    const Vector3 n = normals_.at(normals, k - 1);
    for (int i = 0; i < 3; ++i)
      b_[i] = before.sigma_[i] > 0 ? sigma_[i] / before.sigma_[i] * before.b_[i] : sigma_[i] * n[i];
  }
  // Calls visit(NormalSequence&).
  template <class Visit>
  void each_sequence(Visit visit) noexcept {
    visit(normals_);
  }

 private:
  Vector3 sigma_, transition_, driving_;
  bool on_;
  NormalSequence normals_;
  Vector3 b_ = Vector3::Zero();
};

}  // namespace imud
