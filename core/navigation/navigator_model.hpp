// NavigatorModel: the aids and the tuning of a unit's own navigation filter.
#pragma once

#include <cstdint>

#include "core/earth/gravitation.hpp"
#include "core/vector.hpp"

namespace imud {

// The errors of gyros and accelerometers for which the filter allows: roots of two-sided densities, not negative.
struct InertialNoise {
  double gyro = 0;                // rad/sqrt(s), angular random walk
  double accelerometer = 0;       // m/s/sqrt(s), velocity random walk
  double gyro_walk = 0;           // rad/s/sqrt(s), of the gyros' bias
  double accelerometer_walk = 0;  // m/s^2/sqrt(s)
  // Standard deviations: of scale factors and misalignments (dimensionless), and of the gyros' g-sensitivity,
  // rad/s/(m/s^2). In a manoeuvre these cause errors of the measured rates and forces. The filter treats these errors
  // as noise with the correlation time manoeuvre_s.
  double gyro_scale = 0, accelerometer_scale = 0, g_sensitivity = 0;
  // The same of misalignments alone, for a filter that estimates the scale factors.
  double gyro_misalignment = 0, accelerometer_misalignment = 0;
  static constexpr double manoeuvre_s = 5;  // chosen
};

// Which aids the filter has, and how it is tuned. Vectors are north, east, down.
struct NavigatorModel {
  enum class Alignment : std::uint8_t {
    coarse,  // by gravity, the magnetic field or the course, and the receiver's velocity
    truth,   // the first sample of a run has the true attitude, to study drift
  };
  enum class Kind : std::uint8_t {
    inertial,  // attitude, velocity and position, by a receiver's fixes (Navigator)
    attitude,  // attitude alone, by gravity and the magnetic field (AttitudeReference); no fix is used
  };
  bool is_on = false;
  Kind kind = Kind::inertial;
  Alignment alignment = Alignment::coarse;
  double alignment_s = 1;                // the window of the coarse alignment, above 0
  double gnss_rate_hz = 5;               // of the receiver's fixes; 0: none is used after the alignment
  double magnetic_rate_hz = 10;          // of the magnetic heading; 0: none is used after the alignment
  Vector3 position = {1.5, 1.5, 3.0};    // m, standard deviations of the noise of a fix, above 0
  Vector3 velocity = {0.05, 0.05, 0.1};  // m/s
  // The exponentially correlated errors of a fix, which the filter estimates: standard deviations, and times above 0.
  Vector3 slow_position = Vector3::Zero(), slow_velocity = Vector3::Zero();
  double slow_position_s = 600, slow_velocity_s = 60;
  double heading = 0.035;  // rad, of a magnetic heading
  // The rate of barometric heights; 0: none is used. The difference of a height by the standard atmosphere from one
  // above the ellipsoid is estimated, as a random walk: weather, the geoid, and the barometer's own errors.
  double barometer_rate_hz = 0;
  double barometric_height = 1;  // m, standard deviation of one height, above 0; chosen
  // m/sqrt(s), above 0: PX4's baro_bias_nsd (PX4-Autopilot, src/modules/ekf2/EKF/common.h, commit 0058953e).
  double barometric_walk = 0.13;
  static constexpr double barometric_offset = 500;  // m, standard deviation of the difference at the begin; chosen
  bool zero_velocity = false;                       // zero velocity is an aid when the vehicle is found to be at rest
  double quiet_acceleration = 0.2;  // m/s^2, above 0, of a vehicle without manoeuvres (attitude); chosen
  InertialNoise noise;
  double gyro_bias = 0, accelerometer_bias = 0;  // rad/s, m/s^2: standard deviations at the begin
  // Whether the scale factors are estimated from the begin on; their standard deviations then; and the one of the
  // accelerometers' bias, m/s^2, which then does not contain the scale factor's error in gravity.
  bool estimates_scale_factors = false;
  double gyro_scale_factor = 0, accelerometer_scale_factor = 0, accelerometer_bias_beside_scale = 0;
  // A measurement is rejected where the square of its innovation, in units of the covariance, is above this; after
  // `accept_after_s` of rejections alone the filter adds to its covariance, and accepts.
  double gate = 25;
  double accept_after_s = 10;
  // For the inertial kind: the time of rejections after which headings of antennas, or of the field, are accepted.
  // This time is longer, because fixes measure the heading, too, in manoeuvres, and because a field is disturbed for
  // a while more often than a receiver; chosen.
  double accept_heading_after_s = 120;
  GravitationModel gravitation;  // of the truth's world
};

constexpr double square(double x) noexcept { return x * x; }

// Returns the number of samples from one measurement of an aid to the next; 0: it has none (tuning.cpp).
std::uint64_t samples_between(double rate_hz, double aid_hz) noexcept;

}  // namespace imud
