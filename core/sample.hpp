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
inline constexpr std::uint32_t at_rest = 1U << 9;             // there was no truth yet: a vehicle at rest is sensed
}  // namespace status

// Where on Earth a sample was taken, and when, as the truth has it, without errors (frames E and L: core/README.md).
struct Navigation {
  bool is_known = false;               // or all the rest is 0
  std::int64_t gps_ns = 0;             // GPS time, since 1980-01-06
  double latitude = 0, longitude = 0;  // rad, geodetic, WGS 84
  double height = 0;                   // m, above the ellipsoid
  Vector3 r_E = Vector3::Zero();       // m
  Vector3 v_L = Vector3::Zero();       // m/s, relative to the Earth
};

struct Sample {
  DeviceTime time;                           // of the end of the step
  std::uint64_t counter = 0;                 // 0 for the first sample after start, +1 each
  Vector3 rate = Vector3::Zero();            // rad/s, at `time`
  Vector3 specific_force = Vector3::Zero();  // m/s^2, at `time`
  Vector3 delta_angle = Vector3::Zero();     // rad, over the step that ends at `time`; 0 in the first sample of a run
  Vector3 delta_velocity = Vector3::Zero();  // m/s, likewise
  double temperature_c = 25.0;               // degrees Celsius
  // For devices that know more than an IMU does. True attitude of the platform relative to north-east-down, v_L =
  // q_LP * v_P; where the truth's N is not known to stand to the Earth, N is taken for L.
  Quaternion q_LP = Quaternion::Identity();
  Navigation navigation;                     // true, of the sensor's point
  Vector3 magnetic_field = Vector3::Zero();  // T; 0 where the place is unknown
  double pressure = 0;                       // Pa; likewise
  std::uint32_t status = 0;
};

}  // namespace imud
