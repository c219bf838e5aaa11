// IntegratedErrors: the errors of an imu's measurements, summed over a run, and up to instants of it.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "core/time.hpp"
#include "core/vector.hpp"
#include "emulator/record/measurement_rows.hpp"
#include "protocols/protocol.hpp"

namespace imud {

// Sums over the measurements of a run, without the first one: a product may begin the increments of its first
// measurement at any earlier sample.
struct MeasuredSums {
  Vector3 delta_angle = Vector3::Zero();     // rad
  Vector3 delta_velocity = Vector3::Zero();  // m/s
  Vector3 rate = Vector3::Zero();            // rad/s
  Vector3 specific_force = Vector3::Zero();  // m/s^2
  std::uint64_t measurements = 0;            // the first one included
  std::uint32_t fields = 0;                  // Measurement::Field that all measurements have

  void add(const Measurement& measurement) noexcept;
};

// The same sums of the truth, at the measurements of a run without faults.
struct TrueSums {
  MeasuredSums sums;
  double interval_s = 0;  // between two measurements, the mean

  void add(const TrueRow& row) noexcept;

 private:
  std::int64_t first_ns_ = 0;
};

// The sums of the truth up to the instants T, 2 T, ... after the first measurement, and to the end.
struct TrueSumsOverTime {
  Nanoseconds every{0};          // T; 0: there are no instants
  Nanoseconds half_interval{0};  // of the measurements: a measurement this long after an instant belongs to it
  std::vector<TrueSums> at;
  TrueSums end;

  TrueSumsOverTime(std::span<const TrueRow> rows, Nanoseconds every);
};

// The sums of the measurements at the same instants. Allocates in the constructor only.
class MeasuredSumsOverTime {
 public:
  explicit MeasuredSumsOverTime(const TrueSumsOverTime& truth)
      : every_(truth.every), half_interval_(truth.half_interval), at_(truth.at.size()) {}

  // Adds a measurement. `time` is the time of the frame that completes the measurement, by the device's clock.
  void add(const Measurement& measurement, DeviceTime time) noexcept;
  // Returns the sums up to an instant, or up to the end if no measurement came after the instant.
  const MeasuredSums& at(std::size_t instant) const noexcept { return instant < reached_ ? at_[instant] : end_; }
  const MeasuredSums& end() const noexcept { return end_; }

 private:
  const Nanoseconds every_, half_interval_;
  std::vector<MeasuredSums> at_;
  std::size_t reached_ = 0;  // instants that are over
  DeviceTime first_;
  MeasuredSums end_;
};

// Returns the errors "angle_error_x_rad", "velocity_error_x_m_per_s" and so on, in the sensor's axes: the measured
// sums less the true sums. The sums are those over the increments if the product sends increments, otherwise over
// rate and specific force, times the interval. The angle error is a sum about an axis, not an attitude. A
// component that the product does not send has no error.
std::vector<std::pair<std::string, double>> integrated_errors(const MeasuredSums& measured, const TrueSums& truth);
// Returns the integrated_errors() at the end, and then up to each instant. The names of the latter end with the time
// of the instant in s, such as "@0.5".
std::vector<std::pair<std::string, double>> integrated_errors(const MeasuredSumsOverTime& measured,
                                                              const TrueSumsOverTime& truth);

}  // namespace imud
