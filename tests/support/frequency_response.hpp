// The frequency response of a SensorFilter, from the textbook and not from the code.
#pragma once

#include <cmath>
#include <complex>

#include "core/effects/sensor_filter.hpp"

namespace imud {

// Returns the gain and the phase (negative: the output lags) of axis 0 to 2 at `frequency_hz`, below half of
// `rate_hz`, the rate at which the filter runs: the transfer function as a ratio of polynomials in 1/z.
inline std::complex<double> frequency_response(const SensorFilter& filter, int axis, double rate_hz,
                                               double frequency_hz) {
  const std::complex<double> delay = std::polar(1.0, -2 * M_PI * frequency_hz / rate_hz);  // 1/z
  if (filter.length > 1) {
    std::complex<double> sum = 0, power = 1;
    for (int i = 0; i < filter.length; ++i, power *= delay) sum += power / static_cast<double>(filter.length);
    return std::pow(sum, filter.stages);
  }
  if (filter.cut_off_hz[axis] == 0) return 1;
  // The poles of the analogue filter lie on a circle of radius 2 rate tan(pi f_c/rate); s = 2 rate (z - 1)/(z + 1).
  const double radius = 2 * rate_hz * std::tan(M_PI * filter.cut_off_hz[axis] / rate_hz);
  const std::complex<double> s = 2 * rate_hz * (1.0 - delay) / (1.0 + delay);
  std::complex<double> response = 1;
  for (int i = 0; i < filter.order; ++i) {
    const std::complex<double> pole = std::polar(radius, M_PI * (0.5 + (2 * i + 1) / (2.0 * filter.order)));
    response *= -pole / (s - pole);
  }
  return response;
}

}  // namespace imud
