// Sample: one output of the sensor model, in SI and in the sensor's platform axes P.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <optional>
#include <type_traits>

#include "core/time.hpp"
#include "core/vector.hpp"

namespace imud {

// The bits of Sample::status.
namespace status {
inline constexpr std::uint32_t gyro_saturated_x = 1U << 0;           // y and z are the next two bits
inline constexpr std::uint32_t accelerometer_saturated_x = 1U << 3;  // y and z: the next two
inline constexpr std::uint32_t truth_extrapolated = 1U << 6;         // the newest truth was older than the sample
inline constexpr std::uint32_t truth_stale = 1U << 7;        // the newest truth was so old that motion was held
inline constexpr std::uint32_t not_valid = 1U << 8;          // the sensor marks the sample as no measurement
inline constexpr std::uint32_t at_rest = 1U << 9;            // there was no truth yet: the vehicle is at rest
inline constexpr std::uint32_t rate_derived = 1U << 10;      // the truth's rate was derived from attitudes
inline constexpr std::uint32_t force_derived = 1U << 11;     // the truth's specific force was derived from poses
inline constexpr std::uint32_t self_test_failed = 1U << 12;  // the sensor's self test reports a failure
inline constexpr std::uint32_t inclinometer_saturated_x = 1U << 13;  // y and z: the next two
}  // namespace status

// A place on the Earth, on WGS 84.
struct Geodetic {
  double latitude = 0, longitude = 0, height = 0;  // rad, rad, m above the ellipsoid
};

// The dilutions of precision of a fix: standard deviations of its errors for ranges with independent errors of 1.
struct Dilution {
  float geometric = 0, position = 0, horizontal = 0, vertical = 0, time = 0, north = 0, east = 0;

  // Returns these where they are the dilutions of a geometry, otherwise the constants that a product reports.
  constexpr const Dilution& known_or(const Dilution& constants) const noexcept {
    return position > 0 ? *this : constants;
  }
};
// The dilutions of a receiver under an open sky; chosen.
inline constexpr Dilution open_sky = {1.65F, 1.44F, 0.80F, 1.20F, 0.80F, 0.57F, 0.57F};

// The line from the main antenna of a receiver to its second one, which gives a heading (gnss/antenna_line.hpp).
struct AntennaLine {
  Vector3 direction_L = Vector3::Zero();  // of length 1, with the error of the measured azimuth
  double sigma = 0;                       // rad, the standard deviation of that azimuth; 0: there is one antenna
  Nanoseconds age{0};                     // not negative, since the receiver has measured it

  // Returns whether the line has a heading: within 10 degrees of the vertical it has none.
  bool has_heading() const noexcept {
    constexpr double least2 = 0.03;  // of its horizontal part
    return sigma > 0 && direction_L.head<2>().squaredNorm() >= least2;
  }
};

// A place and the time of a sample on the Earth (frames E and L: core/README.md).
struct Navigation {
  bool is_known = false;               // if not, place, time and velocity are 0
  std::uint8_t satellites = 12;        // the number that a receiver with a fix uses
  float accuracy_factor = 1;           // the factor on the reported accuracies of position and velocity
  Dilution dilution = {};              // of a receiver with an almanac (gnss/sky.hpp)
  std::int64_t gps_ns = 0;             // GPS time of the sample, ns since 1980-01-06
  Nanoseconds age{0};                  // of position and velocity, not negative: by latency, and since a fix
  double latitude = 0, longitude = 0;  // rad, geodetic, WGS 84
  double height = 0;                   // m, above the ellipsoid
  Vector3 r_E = Vector3::Zero();       // m
  Vector3 v_L = Vector3::Zero();       // m/s, relative to the Earth
  // The origin of relative positions: N's own where N is a local level, elsewhere the vehicle's place (the origin of
  // B) at the first truth of the run, or at rest before it.
  Geodetic origin = {};
  AntennaLine antennas = {};  // of a receiver with a fix and two antennas
};

// The bits of Solution::used and rejected.
namespace aid {
inline constexpr std::uint16_t position = 1U << 0, velocity = 1U << 1;  // the receiver's
inline constexpr std::uint16_t magnetic_heading = 1U << 2;
inline constexpr std::uint16_t antennas_heading = 1U << 3;  // by two antennas
inline constexpr std::uint16_t pressure = 1U << 4;          // the barometer's height
inline constexpr std::uint16_t zero_velocity = 1U << 5;
inline constexpr std::uint16_t gravity = 1U << 6;  // the direction of the specific force
}  // namespace aid

// The navigation solution of a unit that computes its own (navigation/navigator.hpp).
struct Solution {
  enum class State : std::uint8_t {
    aligning,  // the attitude is by gravity and the magnetic field; there is no place
    coasting,  // attitude and place are the filter's, without a fix of the receiver
    aided,     // attitude and place are the filter's, with fixes of the receiver
    levelled,  // the attitude is the filter's, which has no place: an attitude and heading reference
  };
  State state = State::aligning;
  // Bits of namespace aid: whether an aid was used, or rejected, when it was last due. Neither bit is set if the aid
  // was missing.
  std::uint16_t used = 0, rejected = 0;
  float since_fix_s = 0;  // since the last fix that was used
  // Standard deviations by the filter's covariance, of rotations about north, east, down, rad; m/s; m.
  Eigen::Vector3f attitude = Eigen::Vector3f::Zero(), velocity = Eigen::Vector3f::Zero(),
                  position = Eigen::Vector3f::Zero();
  // The filter's estimates of the biases, rad/s and m/s^2, in platform axes, and their standard deviations.
  Eigen::Vector3f gyro_bias = Eigen::Vector3f::Zero(), accelerometer_bias = Eigen::Vector3f::Zero(),
                  gyro_bias_sigma = Eigen::Vector3f::Zero(), accelerometer_bias_sigma = Eigen::Vector3f::Zero();
  // The same of the scale factors, less 1; 0 where the filter does not estimate them.
  Eigen::Vector3f gyro_scale = Eigen::Vector3f::Zero(), accelerometer_scale = Eigen::Vector3f::Zero(),
                  gyro_scale_sigma = Eigen::Vector3f::Zero(), accelerometer_scale_sigma = Eigen::Vector3f::Zero();
  // The receiver's last fix, with the time of the sample; Sample::navigation is the filter's place.
  Navigation receiver = {};
  bool has_epochs = false;        // the receiver makes fixes at a rate of its own (navigation/receiver_fix.hpp)
  std::uint32_t since_epoch = 0;  // if has_epochs: samples since the last epoch; 0: the fix was made at this sample
};

// One output of the sensor.
struct Sample {
  // The time that a product reports with the sample.
  DeviceTime stamp() const noexcept { return time + Nanoseconds{stamp_error_ns}; }
  // The number of the sample by which a product divides its rate, also where a fault makes it report a wrong counter.
  std::uint64_t number() const noexcept { return counter - counter_error; }
  // The fix of the unit's receiver.
  const Navigation& fix() const noexcept { return solution ? solution->receiver : navigation; }
  // The time from the instant of the fix to this sample. It is 0 if the receiver makes a fix with each sample: then
  // the latency is not reported.
  Nanoseconds fix_age() const noexcept {
    return solution && solution->has_epochs ? solution->receiver.age : Nanoseconds{0};
  }
  // The line of the antennas that the receiver has measured; nullptr where it has no fix, one antenna, or no heading.
  const AntennaLine* antennas() const noexcept {
    return fix().is_known && fix().antennas.has_heading() ? &fix().antennas : nullptr;
  }
  // The time from the instant of that measurement to this sample; 0 where there is none.
  Nanoseconds antennas_age() const noexcept { return antennas() != nullptr ? antennas()->age : Nanoseconds{0}; }
  // The place whose GPS time is reported: the receiver's fix while a filter has no place.
  const Navigation& timed() const noexcept { return navigation.is_known ? navigation : fix(); }
  // The GPS time of the instant of the fix, ns since 1980-01-06; without a fix the time of the sample, 0 if unknown.
  std::int64_t fix_gps_ns() const noexcept { return (fix().is_known ? fix() : timed()).gps_ns - fix_age().count(); }

  DeviceTime time;                           // the device's own time at the end of the step
  std::uint64_t counter = 0;                 // the number that a product reports: 0 for the first after the start
  Vector3 rate = Vector3::Zero();            // rad/s, at `time`
  Vector3 specific_force = Vector3::Zero();  // m/s^2, at `time`
  Vector3 delta_angle = Vector3::Zero();     // rad, over the step that ends at `time`; 0 in the first sample of a run
  Vector3 delta_velocity = Vector3::Zero();  // m/s, over that step
  double temperature_c = 25.0;               // degrees Celsius
  std::uint32_t status = 0;                  // bits of namespace status
  std::int32_t stamp_error_ns = 0;           // the error of stamp()
  // The attitude of the platform relative to north-east-down, for products that report an attitude, as a unit
  // quaternion: v_L = q_LP * v_P; the true one, unless it is a filter's solution. Where the relation of N to the
  // Earth is unknown (EarthModel::Frame::none), N is taken as L.
  Quaternion q_LP = Quaternion::Identity();
  std::optional<Vector3> inclination;  // m/s^2, the specific force by the inclinometers; nullopt: it has none
  // The members from here on are as initialised if `has_surroundings` is false and there is no solution.
  Navigation navigation;                     // the sensor's point S
  Vector3 magnetic_field = Vector3::Zero();  // T; 0 where the place is unknown
  double pressure = 0;                       // Pa; 0 if unknown
  bool has_surroundings = false;             // place, field and pressure were looked for
  // The error of `counter`, modulo 2^64: not 0 only in a sample whose counter a fault has changed.
  std::uint64_t counter_error = 0;
  std::optional<Solution> solution;  // nullopt: q_LP and navigation are the truth's, with NavigationErrors
};

// Copies a whole sample. An assignment has the same result, but copies each number alone, because Eigen's assignment
// is not trivial. The solution, nearly a half of the sample's size, is only copied where there is one.
inline void copy(const Sample& from, Sample& to) noexcept {
  static_assert(std::is_trivially_destructible_v<Sample> && std::is_standard_layout_v<Sample>);
  if (from.solution) {
    std::memcpy(static_cast<void*>(&to), &from, sizeof to);
  } else {
    std::memcpy(static_cast<void*>(&to), &from, offsetof(Sample, solution));
    to.solution.reset();
  }
}

// The members before `navigation` as bytes: three cache lines of the thirteen of a sample.
using SampleOfMotion = std::array<std::byte, offsetof(Sample, navigation)>;

inline void copy(const Sample& from, SampleOfMotion& to) noexcept { std::memcpy(&to, &from, to.size()); }
// Leaves the other members of `to` as they are.
inline void copy(const SampleOfMotion& from, Sample& to) noexcept {
  std::memcpy(static_cast<void*>(&to), &from, from.size());
}

// Sums of the increments of several samples, for products that send fewer samples than they take.
struct Increments {
  Vector3 delta_angle = Vector3::Zero(), delta_velocity = Vector3::Zero();
  std::int64_t samples = 0;

  void add(const Sample& sample) noexcept {
    delta_angle += sample.delta_angle;
    delta_velocity += sample.delta_velocity;
    ++samples;
  }
};

}  // namespace imud
