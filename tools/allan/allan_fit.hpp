// fit_allan_terms: the terms N, B, K, Q and R that explain an Allan deviation.
#pragma once

#include <array>
#include <optional>

#include "tools/allan/allan_curve.hpp"
#include "tools/allan/allan_term_list.hpp"

namespace imud {

struct AllanFit {
  struct Term {
    // nullopt: the term is not detected, because the noise of the other terms alone gives an estimate of this size
    // with a probability above false_alarm.
    std::optional<double> value;
    double error = 0;       // standard error of value
    double least_seen = 0;  // the least value that would be detected; infinite if no value would
  };
  std::array<Term, allan_term_count> terms;  // in the order of allan_term_list
  // The relative error of the model's variance that explains why the points are farther from the model than their
  // degrees of freedom allow; 0 if they are not. This error is part of the standard errors. A large error means
  // that the recording has something else than these terms: a filter, a vibration, a change of temperature.
  double misfit = 0;
  // The averaging time from which on the flicker is flat, s; 0: the flicker is flat at all averaging times, or no
  // flicker is detected. imud's flicker begins at bias_instability_from_s. The uncertainty of this time is part of
  // the standard errors.
  double flicker_from_s = 0;

  // Returns the detected terms; all other terms are 0.
  AllanTerms seen() const noexcept;
};

// The probability with which a term that is absent is detected nevertheless.
inline constexpr double false_alarm = 1e-3;

// Fits the model of unit_variances() to the points of the curve from `from_s` to `to_s`, by weighted least squares in
// which no term is negative. If flicker is seen, so is the averaging time at which it begins, up to a hundredth of
// the record: first without quantization, which could make up for what the flicker lacks at shorter times. The
// weights are the degrees of freedom at the fitted variance, repeated until they agree. The points' correlation, by
// the density of the fitted terms, is part of the standard errors. Terms that are not seen are left out, beginning
// with the least probable. Returns no term for fewer than two points, or a deviation of 0.
AllanFit fit_allan_terms(const AllanCurve& curve, double from_s, double to_s);

}  // namespace imud
