// AttitudeFilter: an error-state Kalman filter of attitude and gyro bias, by gravity and headings.
#pragma once

#include <Eigen/Core>

#include "core/navigation/navigator_model.hpp"
#include "core/navigation/strapdown.hpp"

namespace imud {

// The errors for which an AttitudeFilter allows.
struct AttitudeTuning {
  InertialNoise noise;            // accelerometer_walk and accelerometer_scale are not used
  double acceleration = 0.2;      // m/s^2, standard deviation on each axis, of the quiet vehicle; above 0
  double accelerometer_bias = 0;  // m/s^2, standard deviation
  double gravity = 9.80665;       // m/s^2, above 0
  double unmodelled_rate = 0;     // rad/s, a rate that is constant in L, such as the Earth's
};

// The states are errors: true attitude = exp(phi) estimate, with phi in L, and the true gyro bias less the estimate,
// in platform axes (Solà, Quaternion kinematics for the error-state Kalman filter, 2017, section 7, with global
// angular errors). L is taken not to rotate: the Earth's rate and the transport rate become a bias.
//
//   phi' = -C (b + n)    b' = w    C: the rotation from P to L
//
// Every period the mean of the specific force in L is taken for the reaction of gravity, which points up: the
// rotation between the two is measured. An acceleration a of the vehicle is an error of a/g, and counts as noise of a
// correlation time of `acceleration_s`. Its variance is adaptive:
//
//   A^2 = A0^2 + max(0, | |f| - g | - m)^2 + min(v w, A1)^2,    the largest of about the last second
//
// with A0 the quiet vehicle's; m three standard deviations of the accelerometers' errors and the difference of
// gravity on the Earth; w the rate about the vertical, in which a vehicle of the speed v = `turning_speed` has the
// centripetal acceleration v w, up to A1 = `largest_turn`. Makers adapt in this way: Aceinna's AHRS reduces the gain
// of its accelerometers above a yaw rate, as turns have centripetal acceleration, and has a switch for linear
// acceleration (docs_aceinna-dmu380, apps/ahrs.rst). A slow turn that is coordinated hides its
// acceleration from both: the solution leans towards the apparent vertical, as VectorNav states of its own without a
// velocity (UM001, VN-100 User Manual, page 107).
//
// The same bits on every machine; nothing here allocates, locks or throws; not thread-safe.
class AttitudeFilter {
 public:
  static constexpr int phi = 0, gyro_bias = 3, states = 6;
  static constexpr double period_s = 0.02;          // of the covariance and of gravity
  static constexpr double acceleration_s = 1;       // chosen
  static constexpr double turning_speed = 5;        // m/s, chosen
  static constexpr double largest_turn = 5;         // m/s^2, chosen
  static constexpr double gravity_of_place = 0.03;  // m/s^2, the range of gravity on the Earth about standard gravity
  using Covariance = Eigen::Matrix<double, states, states>;
  using State = Eigen::Matrix<double, states, 1>;

  AttitudeFilter(const IncrementDefinitions& definitions, const AttitudeTuning& tuning) noexcept
      : strapdown_({.kind = GravitationModel::Kind::none}, definitions), tuning_(tuning) {}

  const Quaternion& q_LP() const noexcept { return strapdown_.state().q_NP; }  // L stands for the strapdown's N
  const Vector3& gyro_bias_P() const noexcept { return gyro_bias_; }           // rad/s
  // The covariance at the end of the last period; symmetric.
  const Covariance& covariance() const noexcept { return P_; }
  const AttitudeTuning& tuning() const noexcept { return tuning_; }
  // Returns the variance, m^2/s^4, of the vehicle's acceleration for which the last period allowed, without the quiet
  // vehicle's A0^2.
  double manoeuvre2() const noexcept { return manoeuvre2_; }

  // Begins at an attitude without a bias, with that covariance.
  void begin(const Quaternion& q_LP, const Covariance& covariance) noexcept;
  // Integrates the increments of one step of `dt` s, above 0, and levels at the end of each period.
  void advance(const Vector3& delta_angle, const Vector3& delta_velocity, double dt) noexcept;

  // A measurement of a rotation: the component of phi along an axis, which needs not be a unit vector.
  struct Heading {
    Vector3 axis_L = Vector3::UnitZ();
    double innovation = 0;  // rad, measured less estimated
    double variance = 1;    // rad^2, above 0
  };
  // Returns the square of the innovation in units of its variance.
  double normalized_square(const Heading& heading) const noexcept;
  void update(const Heading& heading) noexcept;
  // Sets the heading: turns the attitude by `angle`, rad, about the down axis. The error of the heading then has the
  // variance `variance`, rad^2, above 0, and no correlation with the other states.
  void turn(double angle, double variance) noexcept;
  // Sets whether the direction of the specific force is used. Default: it is.
  void set_levelling(bool is_on) noexcept { levels_ = is_on; }
  // Adds to the variance of the rotation about down, rad^2.
  void add_heading_variance(double variance) noexcept { P_(2, 2) += variance; }

 private:
  void propagate() noexcept;
  void level(const Vector3& dv_L, double t) noexcept;
  void correct(const State& change) noexcept;

  Strapdown strapdown_;  // without gravitation: its velocity is the integral of the specific force of the period
  AttitudeTuning tuning_;
  Vector3 gyro_bias_ = Vector3::Zero();
  Covariance P_ = Covariance::Zero();
  double manoeuvre2_ = 0;
  bool levels_ = true;
  // Sums since the beginning of the present period:
  double time_s_ = 0;
  Matrix3 rotation_s_ = Matrix3::Zero();  // the integral of C
  double turns2_s_ = 0;                   // rad^2/s, the integral of the square of the rate
  double turn_ = 0;                       // rad, about down
};

}  // namespace imud
