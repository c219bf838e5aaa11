#include "core/allan_terms.hpp"

#include <cmath>
#include <cstddef>
#include <numbers>

namespace imud {
namespace {
constexpr double flicker = 2 * std::numbers::ln2 / std::numbers::pi;  // Allan variance of B = 1

// Returns whether the process per sample of an axis is x <- factor x + P n, without other axes and without a bound
// that acts.
bool is_walk_by(const TriadErrors& errors, int axis, double factor) {
  Vector3 row = Vector3::Zero();
  row[axis] = factor;
  return errors.walk_transition.row(axis).transpose() == row && (factor == 0 || errors.walk_bound[axis] == 0);
}
}  // namespace

double AllanTerms::minimum() const { return std::sqrt(2 * N * K / std::numbers::sqrt3 + flicker * B * B); }

std::optional<double> bias_instability_of(double minimum, double N, double K) {
  const double least = AllanTerms{.N = N, .K = K}.minimum();
  if (minimum < least) return std::nullopt;
  return std::sqrt((minimum - least) * (minimum + least) / flicker);
}

std::array<AllanTerms, 3> allan_terms(const TriadErrors& errors, double rate_hz) {
  const Vector3 step = errors.walk_sqrt_cov.rowwise().norm();
  std::array<AllanTerms, 3> axes;
  for (int i = 0; i < 3; ++i) {
    const double white_step = is_walk_by(errors, i, 0) ? 1 / std::sqrt(rate_hz) : 0;
    const double walk_step = is_walk_by(errors, i, 1) ? std::sqrt(rate_hz) : 0;
    axes[static_cast<std::size_t>(i)] = {
        .N = std::hypot(errors.white_density[i], white_step * step[i]),
        .B = errors.bias_instability[i],
        .K = std::hypot(errors.random_walk_density[i], walk_step * step[i]),
        .Q = std::hypot(errors.increment_lsb / std::sqrt(12.0), errors.quantization_noise[i]),
        .R = std::abs(errors.ramp[i])};
  }
  return axes;
}

}  // namespace imud
