// Noise of poses: how large the noise is, and which pose is off by more than the noise.
#pragma once

#include <cstddef>
#include <span>

#include "core/vector.hpp"

namespace imud {

// The functions are pure and thread-safe, allocate nothing and do not throw. The same bits on every machine.

// Returns an estimate of the sum of the variances of the three components of noise, from nine values at increasing
// times, s: the square of their eighth divided difference, scaled so that it has the variance of a value. Motion
// slower than about a quarter of the rate of the values vanishes from it; one estimate has the scatter of a
// chi-squared number of three degrees of freedom. (A. Savitzky and M. J. E. Golay, Smoothing and differentiation of
// data by simplified least squares procedures, Analytical Chemistry 36(8), 1964: such weights, and their noise.)
double noise_energy(std::span<const double, 9> times_s, std::span<const Vector3, 9> values) noexcept;

// The result of a test whether one or several adjacent values fit the other values.
struct DeletedResidual {
  double distance = 0;  // from the quartic polynomial that fits the others, in the unit of the values
  double variance = 0;  // of that distance by the noise of a value of variance 1, all components together
  double ratio = 0;     // of the squared distance and its expected square by the misfit of the others; the F
                        // distribution with 3 and 3 (n - left out - 5) degrees of freedom if the noise is normal
};
// `left_out`: the number of the first value that is tested, of `count`; the result is of the tested value
// with the smallest ratio. There are 8 to 16 values, at increasing times, s; six or more are not tested.
// (The externally studentised residual: R. D. Cook and S. Weisberg, Residuals and Influence in
// Regression, Chapman and Hall 1982.)
DeletedResidual deleted_residual(std::span<const double> times_s, std::span<const Vector3> values,
                                 std::size_t left_out, std::size_t count = 1) noexcept;

}  // namespace imud
