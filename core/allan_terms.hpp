// AllanTerms: what an Allan deviation plot of a sensor at rest shows of its errors.
#pragma once

#include <array>
#include <optional>

#include "core/effects/triad_errors.hpp"

namespace imud {

// The coefficients of IEEE Std 952-1997, Annex C, of one axis. u is the unit of TriadErrors; 0: the term is absent.
// The Allan variance is
//   3 Q^2/tau^2 + N^2/tau + (2 ln2/pi) B^2 + K^2 tau/3 + R^2 tau^2/2
// where B's term is flat only between its averaging times.
struct AllanTerms {
  double N = 0;  // u sqrt(s): random walk of the angle or velocity, the root of the two-sided density of white noise
  double B = 0;  // u: bias instability, of density B^2/(2 pi f); the Allan deviation is flat at 0.664 B
  double K = 0;  // u/sqrt(s): random walk of the rate or specific force
  double Q = 0;  // u s: quantization of the angle or velocity; a converter has LSB/sqrt(12)
  double R = 0;  // u/s: ramp

  // Returns the minimum of the curve of N, B and K, u, which it has at tau = sqrt(3) N/K; without K, its limit for
  // long averaging times. Its square is 2 N K/sqrt(3) + (2 ln2/pi) B^2.
  double minimum() const;
};

// Returns the B with which the curve of N, B and K has this minimum, u. nullopt if N and K alone have a larger one.
std::optional<double> bias_instability_of(double minimum, double N, double K);

// Returns the terms of each axis at this sample rate, Hz. The Gauss-Markov process per sample counts in the N of an
// axis if it is white noise there, and in the K of an axis if it is a random walk without bound there; for both the
// axis must not depend on other axes. Otherwise it does not count, nor does exponentially correlated noise.
std::array<AllanTerms, 3> allan_terms(const TriadErrors& errors, double rate_hz);

}  // namespace imud
