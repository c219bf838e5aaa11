#pragma once

#include <limits>
#include <string_view>

#include "core/effects/triad_errors.hpp"
#include "core/effects/triad_step.hpp"
#include "core/numbers/lanes.hpp"

namespace imud {

// The memo's process, section 2:  error += x,  x <- clamp(A x + P n, +-bound),  n ~ N(0, I), with x = 0 before sample
// 0. A and P are per sample: their meaning changes with the sample rate.
class GaussMarkov {
 public:
  static constexpr std::string_view name = "Gauss-Markov process per sample";
  static constexpr EffectTraits traits = {.is_of_memo = true};
  explicit GaussMarkov(const TriadErrors& errors, Quantity quantity, double = 0)
      : transition_(errors.walk_transition),
        sqrt_cov_(errors.walk_sqrt_cov),
        bound_((errors.walk_bound.array() > 0.0).select(errors.walk_bound, Vector3::Constant(infinity))),
        on_(!errors.walk_sqrt_cov.isZero(0.0)),
        has_memory_(!errors.walk_transition.isZero(0.0)),
        normals_(quantity, Process::gauss_markov) {}
  bool is_on() const noexcept { return on_; }
  void apply(TriadStep& step) noexcept { step.constant_error += lanes(next(step.normals, step.k)); }

  // Returns the error x of sample k, valid until the next call. The last call must have been next(k - 1) or seek(k),
  // unless k is 0.
  // `normals` must be the same in all calls.
  const Vector3& next(const Normals& normals, std::uint64_t k) noexcept {
    if (!on_) return x_;
    const Vector3 n = normals_.at(normals, k);
    Lanes x = transition_ * x_ + sqrt_cov_ * n;
    const Lanes bound = lanes(bound_);
    x = select(x < -bound, -bound, x);
    x_ = vector_of(select(x > bound, bound, x));
    return x_;
  }
  // Makes next(k) return the error that sample k has in the sequence from sample 0. The run time is proportional to k
  // unless A is 0.
  void seek(const Normals& normals, std::uint64_t k) noexcept {
    x_.setZero();
    if (!on_ || !has_memory_) return;  // white noise
    for (std::uint64_t j = 0; j < k; ++j) next(normals, j);
  }
  void power_on(std::uint64_t) noexcept {}
  void continue_from(const GaussMarkov& before, const Normals&, std::uint64_t) noexcept { x_ = before.x_; }
  template <class Visit>
  void each_sequence(Visit visit) noexcept {
    visit(normals_);
  }

 private:
  static constexpr double infinity = std::numeric_limits<double>::infinity();
  LaneMatrix transition_, sqrt_cov_;
  Vector3 bound_;  // infinite: none
  bool on_;
  bool has_memory_;
  NormalSequence normals_;
  Vector3 x_ = Vector3::Zero();
};

}  // namespace imud
