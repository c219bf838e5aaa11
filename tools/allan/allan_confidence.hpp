// allan_confidence: how far a deviation may be from the true one (NIST SP1065, sections 5.3 to 5.5).
//
// Every function is pure and may run in any thread.
#pragma once

#include <cstddef>
#include <optional>
#include <span>

#include "tools/allan/allan_deviation.hpp"

namespace imud {

// A noise type is the exponent alpha of the rate's spectral density, which is proportional to f^alpha: 2
// quantisation, 1 flicker of the angle, 0 white (random walk of the angle), -1 flicker (bias instability), -2 rate
// random walk, -3 flicker walk, -4 random run.
inline constexpr int whitest_noise = 2;
// Returns the least exponent for which the deviation exists: -2, or -4 for a Hadamard deviation.
int reddest_noise(AllanKind kind) noexcept;

// Identifies the noise that dominates at an averaging time of `factor` samples, by the lag-1 autocorrelation of
// the averages less their linear trend (SP1065, 5.5.3). Returns nullopt for fewer than 30 averages, which are too
// few, and for averages that lie on a line. `phase`: as phase_of() returns it. `sum_of_points`: the sum of the
// phase at 0 and at all multiples of the factor, if known.
std::optional<int> identify_noise(AllanKind kind, std::span<const double> phase, std::size_t factor,
                                  const ResidentPages& resident = {},
                                  std::optional<double> sum_of_points = std::nullopt);

// Returns the equivalent number of degrees of freedom of a deviation: by Greenhall and Riley, "Uncertainty of
// stability variances based on finite differences" (35th PTTI, 2003), which is SP1065 5.4; for the total deviation of
// white and redder noise by SP1065, table 7. At least 1. `points`: the size of the phase; `alpha` from
// reddest_noise(kind) to whitest_noise; 1 <= factor <= largest_factor(kind, points).
double degrees_of_freedom(AllanKind kind, int alpha, std::size_t points, std::size_t factor);

// The bounds between which the true deviation lies with the given probability; it lies above and below the bounds
// with equal probability.
struct DeviationBounds {
  double low = 0, high = 0;
};
// 0 < confidence < 1. The variance has a chi-square distribution with `degrees` of freedom: SP1065 (44).
DeviationBounds deviation_bounds(double deviation, double degrees, double confidence);

}  // namespace imud
