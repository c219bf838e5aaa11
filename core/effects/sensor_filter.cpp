#include "core/effects/sensor_filter.hpp"

#include <cmath>

#include "core/numbers/elementary.hpp"
#include "core/units.hpp"

namespace imud {

double detail::prewarped(double cut_off_hz, double rate_hz) noexcept {
  const auto [sin, cos] = elementary::sincos(units::pi * cut_off_hz / rate_hz);
  return sin / cos;
}

std::complex<double> frequency_response(const SensorFilter& filter, int axis, double rate_hz, double frequency_hz) {
  const double half = units::pi * frequency_hz / rate_hz;  // rad, half the phase from sample to sample
  std::complex<double> response = 1;
  if (filter.length > 1 && half != 0) {
    const double length = filter.length;
    const double boxcar = std::sin(length * half) / (length * std::sin(half));
    const std::complex<double> stage = std::polar(1.0, -(length - 1) * half) * boxcar;
    for (int i = 0; i < filter.stages; ++i) response *= stage;
  }
  if (filter.cut_off_hz[axis] > 0) {
    const std::complex<double> s(0, std::tan(half) / detail::prewarped(filter.cut_off_hz[axis], rate_hz));
    const detail::Sections sections = detail::sections(filter.order);
    if (sections.count == 0) response /= 1.0 + s;
    for (int i = 0; i < sections.count; ++i) response /= 1.0 + sections.damping[i] * s + s * s;
  }
  return response;
}

double group_delay_s(const SensorFilter& filter, int axis, double rate_hz) {
  double delay = filter.stages * 0.5 * (filter.length - 1) / rate_hz;
  if (filter.cut_off_hz[axis] > 0) {
    const detail::Sections sections = detail::sections(filter.order);
    double damping = sections.count == 0 ? 1 : 0;
    for (int i = 0; i < sections.count; ++i) damping += sections.damping[i];
    // The phase is -damping * pi f/rate/prewarped near f = 0.
    delay += 0.5 * damping / (rate_hz * detail::prewarped(filter.cut_off_hz[axis], rate_hz));
  }
  return delay;
}

}  // namespace imud
