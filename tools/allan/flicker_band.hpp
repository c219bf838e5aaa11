// flicker_band: flicker noise that begins at an averaging time, as in imud and in real sensors.
//
// Every function is pure and may run in any thread.
#pragma once

#include "tools/allan/allan_term_list.hpp"

namespace imud {

// Returns the squared response of a deviation over `m` samples to a rate of frequency f, Hz: it combines the
// response of the mean over the averaging time and of the differences of such means. `period` is the period of the
// samples, s. Requires 0 < f < 0.5/period. The variance is twice the integral over f of the response and the
// two-sided density.
double allan_response(AllanKind kind, double f, double period, double m) noexcept;

// Flicker whose deviation is flat from an averaging time on: the exponentially correlated processes of
// core/effects/flicker.hpp, linear between their nodes, but without a last one.
class FlickerBand {
 public:
  // `from_s` is the averaging time from which on the deviation is flat, s; 0: it is flat at all averaging times.
  // `period` is the period of the samples, s.
  FlickerBand(double from_s, double period) noexcept;
  // Returns the two-sided density at f, Hz, relative to B^2/(2 pi f).
  double density(double f) const noexcept;

 private:
  double time_;  // s, correlation time of the first process
  double period_;
};

// Returns the variance of flicker of this band at an averaging time relative to (2 ln2/pi) B^2, or to its counterpart
// for the kind. 1 if from_s is 0; from there on within 10 % of 1.
double flicker_share(AllanKind kind, const AveragingTime& time, double from_s) noexcept;

}  // namespace imud
