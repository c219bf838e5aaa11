#include "core/effects/sensor_filter.hpp"

#include "core/numbers/elementary.hpp"
#include "core/units.hpp"

namespace imud {

double detail::prewarped(double cut_off_hz, double rate_hz) noexcept {
  const auto [sin, cos] = elementary::sincos(units::pi * cut_off_hz / rate_hz);
  return sin / cos;
}

double group_delay_s(const SensorFilter& filter, int axis, double rate_hz) {
  double delay = filter.stages * 0.5 * (filter.length - 1) / rate_hz;
  if (filter.cut_off_hz[axis] > 0) {
    const detail::Sections sections = detail::sections(filter);
    double damping = sections.count == 0 ? 1 : 0;
    for (int i = 0; i < sections.count; ++i) damping += sections.damping[i];
    // The phase is -damping * pi f/rate/prewarped near f = 0.
    delay += 0.5 * damping / (rate_hz * detail::prewarped(filter.cut_off_hz[axis], rate_hz));
  }
  return delay;
}

double group_delay_s(std::span<const double> taps, double rate_hz) {
  double sum = 0, moment = 0;
  for (std::size_t i = 0; i < taps.size(); ++i) {
    sum += taps[i];
    moment += static_cast<double>(i) * taps[i];
  }
  return moment / (sum * rate_hz);
}

}  // namespace imud
