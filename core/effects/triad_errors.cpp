#include "core/effects/triad_errors.hpp"

#include <cmath>

namespace imud {

TriadErrors TriadErrors::white(double density, double rate_hz, double max) {
  TriadErrors errors;
  errors.walk_transition.setZero();
  errors.walk_sqrt_cov = density * std::sqrt(rate_hz) * Matrix3::Identity();
  errors.max = max;
  return errors;
}

}  // namespace imud
