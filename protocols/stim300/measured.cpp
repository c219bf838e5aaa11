#include "protocols/stim300/measured.hpp"

#include <algorithm>
#include <cmath>

#include "core/units.hpp"
#include "protocols/wire.hpp"

namespace imud::stim300 {

void Measured::add(const Sample& sample, bool is_starting, Memory& memory) noexcept {
  time_ = sample.time;
  counter_ = sample.counter & 0xFFU;
  const bool outside = sample.temperature_c < -40 || sample.temperature_c > 85;  // Table 5-1
  status_ = (is_starting ? status_bit::start_up : 0U) | (outside ? status_bit::outside : 0U) |
            ((sample.status & status::not_valid) != 0 ? status_bit::integrity : 0U);
  temperature_c_ = sample.temperature_c;
  const auto put = [&](Cluster cluster, const Vector3& value, const Vector3& step, unsigned overloaded) {
    constexpr double dt = 1 / internal_hz;
    unsigned bits = status_;
    for (unsigned i = 0; i < 3; ++i)
      if ((overloaded >> i & 1U) != 0) bits |= memory.overload(cluster, i);
    axes_[cluster].add(value + memory.trim[cluster], step + dt * memory.trim[cluster], bits);
  };
  put(gyro, sample.rate / units::degree, sample.delta_angle / units::degree, sample.status & 7U);
  const Vector3 f = sample.specific_force / units::standard_gravity;
  put(accelerometer, f, sample.delta_velocity / units::standard_gravity,
      sample.status / status::accelerometer_saturated_x & 7U);
  unsigned tilted = 0;
  for (int i = 0; i < 3; ++i) tilted |= std::abs(f[i]) >= inclinometer_overload_g ? 1U << i : 0U;
  const Vector3 level = f.cwiseMax(-inclinometer_end_g).cwiseMin(inclinometer_end_g);
  put(inclinometer, level, level / internal_hz, tilted);
}

Reading Measured::reading(std::uint32_t pps, Nanoseconds latency) const noexcept {
  return {
      .temperature_c = temperature_c_,
      .status = status_,
      .pps = pps,
      .pps_status = status_ | (pps == longest_pps ? status_bit::overload : 0U),
      .counter = counter_,
      .latency_us = static_cast<unsigned>(std::clamp<std::int64_t>(to_integer(1e6 * seconds(latency)), 0, 0xFFFF))};
}

}  // namespace imud::stim300
