// IntegratedErrors: the errors of an imu's measurements, summed over a run.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "core/vector.hpp"
#include "emulator/record/measurement_rows.hpp"
#include "protocols/protocol.hpp"

namespace imud {

// Sums from the first measurement of a run to the last. The first one itself does not count, because a product may
// begin its increments at any sample before it.
struct MeasuredSums {
  Vector3 delta_angle = Vector3::Zero();     // rad
  Vector3 delta_velocity = Vector3::Zero();  // m/s
  Vector3 rate = Vector3::Zero();            // rad/s
  Vector3 specific_force = Vector3::Zero();  // m/s^2
  std::uint64_t measurements = 0;            // the first one included
  std::uint32_t fields = 0;                  // Measurement::Field that all have

  void add(const Measurement& measurement) noexcept;
};

// The same of the truth at the measurements of a run without faults.
struct TrueSums {
  MeasuredSums sums;
  double interval_s = 0;  // between two measurements, the mean

  TrueSums() = default;
  explicit TrueSums(std::span<const TrueRow> rows) noexcept;
};

// Returns "angle_error_x_rad", "velocity_error_x_m_per_s" and so on, with the measured sums less the true ones: the
// increments' where the product sends them, else of rate and specific force, times the interval. In the sensor's
// axes; the sum of delta-angles about an axis, not an attitude. `absent_rates`: of Protocol.
std::vector<std::pair<std::string, double>> integrated_errors(const MeasuredSums& measured, const TrueSums& truth,
                                                              unsigned absent_rates);

}  // namespace imud
