#include "core/pose/pose_noise.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace imud {

double noise_energy(std::span<const double, 9> times_s, std::span<const Vector3, 9> values) noexcept {
  // The result depends on the ratio of the weights alone. `scale` is therefore the unit of time: a product of eight
  // differences of times in seconds may underflow.
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
                                 std::size_t left_out, std::size_t count) noexcept {
  constexpr std::size_t degree = 4, most = 16;
  const std::size_t n = times_s.size();
  const double origin = times_s[left_out];
  const double scale = std::max({times_s.back() - origin, origin - times_s.front(), 1e-9});
  const auto is_left_out = [&](std::size_t i) { return i >= left_out && i < left_out + count; };
  std::array<double, most> x{}, now{}, before{}, variance{};
  std::array<Vector3, most> rest;
  for (std::size_t i = 0; i < n; ++i) {
    x[i] = (times_s[i] - origin) / scale;
    now[i] = 1.0;
    rest[i] = values[i];
    variance[i] = 1.0;
  }
  // Orthogonal polynomials on the other values, as in PolynomialFit. Tested values have no weight.
  double square_before = 1.0;
  for (std::size_t k = 0; k <= degree; ++k) {
    double square = 0.0, moment = 0.0;
    Vector3 sum = Vector3::Zero();
    for (std::size_t i = 0; i < n; ++i) {
      if (is_left_out(i)) continue;
      square += now[i] * now[i];
      moment += x[i] * now[i] * now[i];
      sum += now[i] * rest[i];
    }
    if (square < 1e-12) break;
    const Vector3 coefficient = sum / square;
    const double alpha = moment / square, beta = k == 0 ? 0.0 : square / square_before;
    for (std::size_t i = 0; i < n; ++i) {
      variance[i] += now[i] * now[i] / square;
      rest[i] -= now[i] * coefficient;
      const double next = (x[i] - alpha) * now[i] - beta * before[i];
      before[i] = now[i];
      now[i] = next;
    }
    square_before = square;
  }
  double misfit = 0.0;
  for (std::size_t i = 0; i < n; ++i)
    if (!is_left_out(i)) misfit += rest[i].squaredNorm();
  misfit /= static_cast<double>(n - count - (degree + 1));
  constexpr double most_ratio = 1e12;
  DeletedResidual result;
  for (std::size_t i = left_out; i < left_out + count; ++i) {
    const double expected = variance[i] * misfit, energy = rest[i].squaredNorm();
    const double ratio = energy < most_ratio * expected ? energy / expected : (energy > 0.0 ? most_ratio : 0.0);
    if (i == left_out || ratio < result.ratio) result = {std::sqrt(energy), variance[i], ratio};
  }
  return result;
}

}  // namespace imud
