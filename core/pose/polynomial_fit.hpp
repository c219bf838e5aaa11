// PolynomialFit: the derivatives, at one instant, of the polynomials that fit vectors given at other instants.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/vector.hpp"

namespace imud {

// Fits polynomials in time by least squares, of the eighth degree. Where more than two thirds of the other points lie
// to one side of time 0, the noise of a derivative rises steeply with the degree. There the degree for n points is
// 4 + (n + 3)/8, at most 8. Further degrees, up to 10, are added as long as their coefficient stands out of the noise
// beyond doubt. Coefficients from the second degree on are reduced by factors that fall with the degree and minimise
// the estimated mean squared error, given the noise of the residuals: monotone shrinkage (R. Beran and L. Duembgen,
// Modulation of estimators and confidence sets, The Annals of Statistics 26(5), 1998). A constant rate is thus fitted
// by a line, and a motion that stands out of the noise is hardly reduced.
//
// The constructor allocates all memory; nothing else here allocates, locks or throws. The same bits on every machine.
// Not thread-safe.
class PolynomialFit {
 public:
  struct Derivatives {
    Vector3 value = Vector3::Zero(), first = Vector3::Zero(), second = Vector3::Zero();  // per s, per s^2
    // The variance of a component of the derivatives, not reduced, by noise of variance 1: the noise gain of the
    // filter that the fit is (A. Savitzky and M. J. E. Golay, Analytical Chemistry 36(8), 1964).
    double first_gain = 0, second_gain = 0;  // 1/s^2, 1/s^4
  };

  explicit PolynomialFit(std::size_t most_points);

  void clear() noexcept { count_ = 0; }
  // Adds a point at `time_s`, s, after the time of the previous point. Adds at most `most_points` after clear().
  void add(double time_s, const Vector3& value) noexcept { points_[count_++] = {time_s, 0.0, 1.0, value}; }
  // Selects the fits whose coefficients are reduced: fits whose points lie to one side, or all fits with more points
  // than coefficients, because such points show the noise.
  enum class Reduce : std::uint8_t { to_one_side, always };
  // Returns the derivatives of the fit at time 0. Requires a point at time 0. Must be called only once after the last
  // add().
  Derivatives at_0(Reduce reduce = Reduce::to_one_side) noexcept;

 private:
  struct Point {
    double x;            // s; at_0() divides it by the scale
    double before, now;  // p_k-1 and p_k at x
    Vector3 value;       // at_0() subtracts the fit from it
  };
  std::vector<Point> points_;
  std::size_t count_ = 0;
};

}  // namespace imud
