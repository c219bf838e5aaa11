// The parameters of the node, which the host reads and writes by param.GetSet. Each has the name of the key of
// [imu.device] that sets its value as delivered.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string_view>

namespace imud::dronecan {

enum Key : std::size_t {
  node_id_key,
  raw_imu_hz,
  solution_hz,
  magnetic_field_hz,
  static_pressure_hz,
  static_temperature_hz,
  priority_key,
  sensor_id_key,
  integrals_key,
  gnss_fix2_hz,  // the keys above keep their indices, by which hosts list them
  gnss_auxiliary_hz,
  gyro_filter_hz,
  accelerometer_filter_hz,
  key_count
};

struct Parameter {
  std::string_view name;
  std::int64_t max;  // the lowest value is 0
  bool is_rate;      // a divisor of the sample rate, or 0; `max` is the sample rate's
  bool is_flag;
};
inline constexpr std::int64_t highest_sample_rate = 8000;  // Hz
inline constexpr std::int64_t highest_filter = 256;        // Hz
inline constexpr std::array<Parameter, key_count> parameters = {{
    {"node_id", 125, false, false},
    {"raw_imu_hz", highest_sample_rate, true, false},
    {"solution_hz", highest_sample_rate, true, false},
    {"magnetic_field_hz", highest_sample_rate, true, false},
    {"static_pressure_hz", highest_sample_rate, true, false},
    {"static_temperature_hz", highest_sample_rate, true, false},
    {"priority", 31, false, false},
    {"sensor_id", 255, false, false},
    {"integrals", 1, false, true},
    {"gnss_fix2_hz", highest_sample_rate, true, false},
    {"gnss_auxiliary_hz", highest_sample_rate, true, false},
    {"gyro_filter_hz", highest_filter, false, false},
    {"accelerometer_filter_hz", highest_filter, false, false},
}};

using Values = std::array<std::int64_t, key_count>;  // index: Key

// Returns the index of a parameter, or nullopt.
constexpr std::optional<std::size_t> find_parameter(std::string_view name) noexcept {
  for (std::size_t i = 0; i < parameters.size(); ++i)
    if (parameters[i].name == name) return i;
  return std::nullopt;
}

// The parameters as delivered, as stored, and as in use. `sample_rate` is in Hz.
struct Memory {
  Values factory, stored, active;
  std::int64_t sample_rate;

  std::int64_t highest(std::size_t key) const noexcept {
    return parameters[key].is_rate ? sample_rate : parameters[key].max;
  }
  bool accepts(std::size_t key, std::int64_t value) const noexcept {
    if (value < 0 || value > highest(key)) return false;
    return !parameters[key].is_rate || value == 0 || sample_rate % value == 0;
  }
};

}  // namespace imud::dronecan
