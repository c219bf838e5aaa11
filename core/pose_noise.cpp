#include "core/pose_noise.hpp"

#include <algorithm>

namespace imud {

double noise_energy(std::span<const double, 9> times_s, std::span<const Vector3, 9> values) noexcept {
  // Only the ratio of the weights counts, and products of eight times in seconds may underflow.
  const double scale = std::max(times_s[8] - times_s[0], 1e-9);
  double square = 0.0;
  Vector3 sum = Vector3::Zero();
  for (std::size_t i = 0; i < 9; ++i) {
    double product = 1.0;
    for (std::size_t j = 0; j < 9; ++j)
      if (j != i) product *= 8.0 * (times_s[i] - times_s[j]) / scale;
    const double weight = 1.0 / product;
    square += weight * weight;
    sum += weight * values[i];
  }
  return sum.squaredNorm() / square;
}

DeletedResidual deleted_residual(std::span<const double> times_s, std::span<const Vector3> values,
                                 std::size_t left_out) noexcept {
  constexpr std::size_t degree = 4, most = 16;
  const std::size_t n = times_s.size();
  const double origin = times_s[left_out];
  const double scale = std::max({times_s.back() - origin, origin - times_s.front(), 1e-9});
  std::array<double, most> x{}, now{}, before{};
  std::array<Vector3, most> rest;
  for (std::size_t i = 0; i < n; ++i) {
    x[i] = (times_s[i] - origin) / scale;
    now[i] = 1.0;
    rest[i] = values[i];
  }
  // Orthogonal polynomials on the others, as in PolynomialFit. Those of the value that is tested have no weight.
  DeletedResidual result;
  result.variance = 1.0;
  double square_before = 1.0;
  for (std::size_t k = 0; k <= degree; ++k) {
    double square = 0.0, moment = 0.0;
    Vector3 sum = Vector3::Zero();
    for (std::size_t i = 0; i < n; ++i) {
      if (i == left_out) continue;
      square += now[i] * now[i];
      moment += x[i] * now[i] * now[i];
      sum += now[i] * rest[i];
    }
    if (square < 1e-12) break;
    result.variance += now[left_out] * now[left_out] / square;
    const Vector3 coefficient = sum / square;
    const double alpha = moment / square, beta = k == 0 ? 0.0 : square / square_before;
    for (std::size_t i = 0; i < n; ++i) {
      rest[i] -= now[i] * coefficient;
      const double next = (x[i] - alpha) * now[i] - beta * before[i];
      before[i] = now[i];
      now[i] = next;
    }
    square_before = square;
  }
  double misfit = 0.0;
  for (std::size_t i = 0; i < n; ++i)
    if (i != left_out) misfit += rest[i].squaredNorm();
  result.distance = rest[left_out].norm();
  const double expected = result.variance * misfit / static_cast<double>(n - 1 - (degree + 1));
  const double energy = result.distance * result.distance;
  constexpr double most_ratio = 1e12;
  result.ratio = energy < most_ratio * expected ? energy / expected : (energy > 0.0 ? most_ratio : 0.0);
  return result;
}

}  // namespace imud
