#include "core/allan_terms.hpp"

#include <cmath>
#include <cstddef>

namespace imud {

std::array<AllanTerms, 3> allan_terms(const TriadErrors& errors, double rate_hz) {
  const Vector3 step = errors.walk_sqrt_cov.rowwise().norm();
  const double white_step = errors.walk_transition.isZero(0.0) ? 1 / std::sqrt(rate_hz) : 0;
  const bool is_walk = errors.walk_transition.isIdentity(0.0) && errors.walk_bound.isZero(0.0);
  const double walk_step = is_walk ? std::sqrt(rate_hz) : 0;
  std::array<AllanTerms, 3> axes;
  for (int i = 0; i < 3; ++i)
    axes[static_cast<std::size_t>(i)] = {.N = std::hypot(errors.white_density[i], white_step * step[i]),
                                         .B = errors.bias_instability[i],
                                         .K = std::hypot(errors.random_walk_density[i], walk_step * step[i]),
                                         .Q = errors.increment_lsb / std::sqrt(12.0),
                                         .R = std::abs(errors.ramp[i])};
  return axes;
}

}  // namespace imud
