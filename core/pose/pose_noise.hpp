// Noise of poses: how large the noise is, and which pose is off by more than the noise.
#pragma once

#include <cstddef>
#include <span>

#include "core/vector.hpp"

namespace imud {

// The functions are pure and thread-safe, allocate nothing and do not throw. The same bits on every machine.

// Returns an estimate of the noise in nine values at increasing times, s: the sum of the variances of the three
// components. The estimate is the square of the eighth divided difference of the values, scaled to the variance of a
// value. Motion slower than about a quarter of the rate of the values does not contribute to the estimate. An
// estimate scatters like a chi-squared number of three degrees of freedom. (A. Savitzky and M. J. E. Golay, Smoothing
// and differentiation of data by simplified least squares procedures, Analytical Chemistry 36(8), 1964: such weights,
// and their noise.)
double noise_energy(std::span<const double, 9> times_s, std::span<const Vector3, 9> values) noexcept;

// The result of a test whether one or several adjacent values fit the other values.
struct DeletedResidual {
  // The distance from the quartic polynomial that fits the other values, in the unit of the values.
  double distance = 0;
  // The expected square of the distance, relative to the noise of a value: the sum of the variances of its
  // components.
  double variance = 0;
  // The squared distance, relative to its expected square by the misfit of the other values. Has the F distribution
  // with 3 and 3 (n - count - 5) degrees of freedom if the noise is normal, where n is the number of values.
  double ratio = 0;
};
// Tests `count` adjacent values, from number `left_out` on. Returns the result of the tested value with the smallest
// ratio. Requires 8 to 16 values at increasing times, s, and at least six values that are not tested. (The externally
// studentised residual: R. D. Cook and S. Weisberg, Residuals and Influence in Regression, Chapman and Hall 1982.)
DeletedResidual deleted_residual(std::span<const double> times_s, std::span<const Vector3> values,
                                 std::size_t left_out, std::size_t count = 1) noexcept;

}  // namespace imud
