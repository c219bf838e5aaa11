#include "protocols/stim300/measured.hpp"

#include <algorithm>

#include "core/numbers/dispatch.hpp"
#include "core/numbers/elementary.hpp"
#include "core/numbers/lanes.hpp"
#include "core/units.hpp"
#include "protocols/wire/wire.hpp"

namespace imud::stim300 {

// Section 7.5.2.2.6. The low-pass filter of a source is assumed to be of first order, and starts with its first
// input.
Vector3 Measured::g_compensation(const Configuration& c, const Matrix3& g_sensitivity,
                                 const std::array<Vector3, 2>& sources) noexcept {
  const auto& axes = c.g_compensation;
  Vector3 bias = Vector3::Zero();
  const bool is_on = std::any_of(axes.begin(), axes.end(), [](const GCompensation& g) { return g.bias_source != 0; });
  if (!is_on) {
    has_filtered_ = false;
    return bias;
  }
  const double gain = has_filtered_ ? 1 - elementary::exp(-2 * units::pi * c.g_filter_hz / internal_hz) : 1;
  for (std::size_t i = 0; i < sources.size(); ++i)
    filtered_[i] = has_filtered_ ? Vector3(filtered_[i] + gain * (sources[i] - filtered_[i])) : sources[i];
  has_filtered_ = true;
  for (int i = 0; i < 3; ++i) {
    const GCompensation& g = axes[static_cast<std::size_t>(i)];
    if (g.bias_source == 0) continue;
    const Vector3& source = (g.bias_filter ? filtered_ : sources)[g.bias_source - 1];
    bias[i] = units::standard_gravity * g_sensitivity.row(i).dot(source);
  }
  return bias;
}

IMUD_DISPATCHED void Measured::add(const Sample& sample, bool is_starting, const Matrix3& g_sensitivity,
                                   Memory& memory) noexcept {
  time_ = sample.time;
  counter_ = sample.counter & 0xFFU;
  const bool outside = sample.temperature_c < -40 || sample.temperature_c > 85;  // Table 5-1
  status_ = (is_starting ? status_bit::start_up : 0U) | (outside ? status_bit::outside : 0U) |
            ((sample.status & status::not_valid) != 0 ? status_bit::integrity : 0U) |
            ((sample.status & status::self_test_failed) != 0 ? status_bit::channel : 0U);
  temperature_c_ = sample.temperature_c;
  const auto put = [&](Cluster cluster, Lanes value, Lanes step, unsigned overloaded) __attribute__((always_inline)) {
    constexpr double dt = 1 / internal_hz;
    const Lanes trim = lanes(memory.trim[cluster]);
    unsigned bits = status_;
    for (unsigned i = 0; overloaded >> i != 0; ++i)
      if ((overloaded >> i & 1U) != 0) bits |= memory.overload(cluster, i);
    axes_[cluster].add(value + trim, step + dt * trim, bits);
  };
  const Lanes f = lanes(sample.specific_force) / units::standard_gravity;
  Lanes level = lanes(sample.inclination ? *sample.inclination : sample.specific_force) / units::standard_gravity;
  level = select(level < -inclinometer_end_g, all_lanes(-inclinometer_end_g), level);
  level = select(level > inclinometer_end_g, all_lanes(inclinometer_end_g), level);
  const Lanes bias = lanes(g_compensation(memory.active, g_sensitivity, {vector_of(f), vector_of(level)}));
  put(gyro, (lanes(sample.rate) - bias) / units::degree,
      (lanes(sample.delta_angle) - bias / internal_hz) / units::degree, sample.status & 7U);
  put(accelerometer, f, lanes(sample.delta_velocity) / units::standard_gravity,
      sample.status / status::accelerometer_saturated_x & 7U);
  unsigned tilted = sample.status / status::inclinometer_saturated_x & 7U;
  const Lanes tilt = magnitude(level);
  for (int i = 0; i < 3; ++i) tilted |= tilt[i] >= inclinometer_overload_g ? 1U << i : 0U;
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
