// Sample: one output of the sensor model, in SI and in the sensor's platform axes P.
#pragma once

#include <cstdint>

#include "core/time.hpp"
#include "core/vector.hpp"

namespace imud {

// Bits of Sample::status.
namespace status {
inline constexpr std::uint32_t gyro_saturated_x = 1U << 0;  // y and z: the next two bits
inline constexpr std::uint32_t accelerometer_saturated_x = 1U << 3;
inline constexpr std::uint32_t truth_extrapolated = 1U << 6;  // no truth for this instant (yet)
inline constexpr std::uint32_t truth_stale = 1U << 7;         // none for so long that motion is held
inline constexpr std::uint32_t not_valid = 1U << 8;           // so the sensor itself says that this is no measurement
}  // namespace status

struct Sample {
  DeviceTime time;              // of the end of the step
  std::uint64_t counter = 0;    // 0 for the first sample after start, +1 each
  Vector3 rate = Vector3::Zero();            // rad/s, at `time`
  Vector3 specific_force = Vector3::Zero();  // m/s^2, at `time`
  Vector3 delta_angle = Vector3::Zero();     // rad, over the step that ends at `time`; 0 in the first sample of a run
  Vector3 delta_velocity = Vector3::Zero();  // m/s, likewise
  double temperature_c = 25.0;               // degrees Celsius
  Quaternion q_NP = Quaternion::Identity();  // true attitude of the platform, for devices that give an attitude
  std::uint32_t status = 0;
};

}  // namespace imud
