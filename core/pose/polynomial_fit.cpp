#include "core/pose/polynomial_fit.hpp"

#include <algorithm>
#include <array>
#include <span>

namespace imud {
namespace {

constexpr std::size_t highest_degree = 8, highest_to_one_side = 10;

// A further degree needs a coefficient with this many times the mean energy of higher coefficients. With two of them,
// the fewest, white noise exceeds this in 7e-5 of the fits (F distribution, 3 and 6 degrees of freedom).
constexpr double certain = 60.0;

// The noise is counted this many times, because its estimate and the coefficients scatter. Counted once, a
// coefficient of noise alone remains too often: the rate of a turntable, from float32 at 100 Hz, had the error of a
// spline at the ends, in place of 0.94 of it. In return a coefficient as large as the noise has up to 4 % more error.
constexpr double prudence = 1.5;

// With points on both sides, coefficients are reduced only if there are this many points more than coefficients, so
// that the noise is known well enough.
constexpr std::size_t least_beyond = 8;

struct Term {
  Vector3 coefficient;
  std::array<double, 3> at_0;  // the polynomial and its derivatives
  double energy;               // its part of the sum of squares
};

// Returns the factor of term k: the weighted isotonic regression, falling with the degree, of 1 - noise/energy, by
// its min-max formula. `noise` is the energy of a term without motion.
double factor_of(const std::array<Term, highest_to_one_side + 1>& terms, std::size_t count, std::size_t k,
                 double noise) noexcept {
  double factor = 1.0;
  for (std::size_t i = 2; i <= k; ++i) {
    double largest = 0.0, energy = 0.0;
    for (std::size_t j = i; j < count; ++j) {
      energy += terms[j].energy;
      const double expected = noise * static_cast<double>(j - i + 1);
      if (j >= k && energy > expected) largest = std::max(largest, 1.0 - expected / energy);
    }
    factor = std::min(factor, largest);
  }
  return factor;
}

}  // namespace

PolynomialFit::PolynomialFit(std::size_t most_points) : points_(most_points) {}

// By polynomials that are orthogonal on the times: p_k+1 = (x - alpha) p_k - beta p_k-1. (G. E. Forsythe, Generation
// and use of orthogonal polynomials for data-fitting with a digital computer, J. SIAM 5(2), 1957.)
PolynomialFit::Derivatives PolynomialFit::at_0(Reduce reduce) noexcept {
  const std::size_t n = count_;
  const auto points = std::span(points_).first(n);
  std::size_t before = 0;
  while (points[before].x < 0.0) ++before;
  const auto [shorter, longer] = std::minmax({before, n - 1 - before});
  const bool is_one_sided = longer > 2 * shorter;
  const std::size_t degree = std::min(highest_degree, is_one_sided ? 4 + (n + 3) / 8 : highest_degree);
  const std::size_t highest = is_one_sided && n > 3 ? std::max(degree, std::min(highest_to_one_side, n - 3)) : degree;
  const double scale = std::max({-points.front().x, points.back().x, 1e-9});
  for (Point& point : points) point.x /= scale;

  Derivatives result;
  std::array<Term, highest_to_one_side + 1> terms;
  std::size_t count = 0;
  double residual = 0.0;  // sum of squares
  // p_k and p_k-1, and their derivatives, at x = 0.
  std::array<double, 3> at_0 = {1.0, 0.0, 0.0}, before_at_0 = {};
  double square_before = 1.0;
  for (std::size_t k = 0; k <= highest && k < n; ++k) {
    double square = 0.0, moment = 0.0;
    Vector3 sum = Vector3::Zero();
    for (const Point& point : points) {
      const double p2 = point.now * point.now;
      square += p2;
      moment += point.x * p2;
      sum += point.now * point.value;
    }
    if (square < 1e-12) break;  // these times cannot tell a polynomial of this degree from a lower one
    const Vector3 coefficient = sum / square;
    const double energy = coefficient.squaredNorm() * square;
    if (k > degree && energy * static_cast<double>(n - 1 - k) <= certain * (residual - energy)) break;
    terms[count++] = {coefficient, at_0, energy};
    result.first_gain += at_0[1] * at_0[1] / (scale * scale * square);
    result.second_gain += at_0[2] * at_0[2] / (scale * scale * scale * scale * square);
    const double alpha = moment / square, beta = k == 0 ? 0.0 : square / square_before;
    residual = 0.0;
    for (Point& point : points) {
      point.value -= point.now * coefficient;
      residual += point.value.squaredNorm();
      const double p = (point.x - alpha) * point.now - beta * point.before;
      point.before = point.now;
      point.now = p;
    }
    const std::array<double, 3> next = {-alpha * at_0[0] - beta * before_at_0[0],
                                        at_0[0] - alpha * at_0[1] - beta * before_at_0[1],
                                        2.0 * at_0[1] - alpha * at_0[2] - beta * before_at_0[2]};
    before_at_0 = at_0;
    at_0 = next;
    square_before = square;
  }

  const bool reduces = is_one_sided ? n > count : reduce == Reduce::always && n >= count + least_beyond;
  const double noise = reduces ? prudence * residual / static_cast<double>(n - count) : 0.0;
  for (std::size_t k = 0; k < count; ++k) {
    const Vector3 coefficient = factor_of(terms, count, k, noise) * terms[k].coefficient;
    result.value += terms[k].at_0[0] * coefficient;
    result.first += terms[k].at_0[1] / scale * coefficient;
    result.second += terms[k].at_0[2] / (scale * scale) * coefficient;
  }
  return result;
}

}  // namespace imud
