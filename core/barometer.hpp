// Barometer: the static pressure that a sensor measures.
#pragma once

#include <algorithm>
#include <cstdint>

#include "core/numbers/correlated_noise.hpp"
#include "core/numbers/elementary.hpp"
#include "core/numbers/random.hpp"

namespace imud {

// The errors of a barometer. The default of every member switches its effect off.
struct BarometerErrors {
  double lag_s = 0;                   // time constant of the pressure port, not negative
  double bias = 0;                    // Pa
  double drift = 0;                   // Pa, standard deviation, not negative
  double drift_correlation_s = 3600;  // above 0
  double noise = 0;                   // Pa, standard deviation of one sample, not negative
};

// With samples of period T, the true pressure p becomes
//   y <- y + (1 - exp(-T/lag)) (p - y), the response of a port to a pressure that is constant between samples; y = p
//        in the first sample of a run
//   m = y + bias + b + noise n, at least 0, with exponentially correlated noise b as drift and n ~ N(0, 1)
// Does not allocate, lock or throw; not thread-safe.
class Barometer {
 public:
  Barometer(const BarometerErrors& errors, double period_s) noexcept
      : errors_(errors),
        response_(errors.lag_s > 0 ? 1 - elementary::exp(-period_s / errors.lag_s) : 1),
        drift_(Vector3(errors.drift, 0, 0), Vector3::Constant(errors.drift_correlation_s), period_s,
               Quantity::pressure) {}

  // Returns the measured pressure of sample k, Pa, of the true one. The last call was for sample k - 1, or seek(k).
  double measure(double pressure, const Normals& normals, std::uint64_t k) noexcept {
    if (!is_settled_) lagged_ = pressure;
    is_settled_ = true;
    lagged_ = response_ == 1 ? pressure : lagged_ + response_ * (pressure - lagged_);
    pass(normals, k);
    double measured = lagged_ + errors_.bias + drift_.value().x();
    if (errors_.noise > 0) measured += errors_.noise * normals(Quantity::pressure, Process::gauss_markov, k).x();
    return std::max(measured, 0.0);
  }
  // Passes sample k, in which no pressure is known: the drift continues.
  void pass(const Normals& normals, std::uint64_t k) noexcept {
    if (drift_.is_on()) drift_.next(normals, k);
  }
  // Makes sample k the next, with the drift that it has in the sequence from 0; the lag settles on it. The time it
  // takes is proportional to k if there is a drift.
  void seek(const Normals& normals, std::uint64_t k) noexcept {
    is_settled_ = false;
    drift_.seek(normals, k);
  }
  void forget_numbers() noexcept { drift_.forget_numbers(); }
  // Makes sample k the next, with the memory of `before`.
  void continue_from(const Barometer& before, const Normals& normals, std::uint64_t k) noexcept {
    drift_.continue_from(before.drift_, normals, k);
    lagged_ = before.lagged_;
    is_settled_ = before.is_settled_;
  }
  // Makes the next sample the first of a run.
  void begin_run() noexcept { is_settled_ = false; }

 private:
  BarometerErrors errors_;
  double response_;
  CorrelatedNoise drift_;  // on x
  double lagged_ = 0;
  bool is_settled_ = false;
};

}  // namespace imud
