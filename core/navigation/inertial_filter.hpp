// InertialFilter: an error-state Kalman filter of a strapdown navigator, of 15 states.
#pragma once

#include <Eigen/Core>
#include <array>
#include <span>

#include "core/navigation/navigator_model.hpp"
#include "core/navigation/strapdown.hpp"

namespace imud {

// The states are errors: true attitude = exp(phi) estimate, with phi in N; all others are true value less estimate.
// Biases are in platform axes. Between the updates (Solà, Quaternion kinematics for the error-state Kalman filter,
// 2017, section 7, with global angular errors; Groves, section 14.2.3, without the Earth's rotation, as N is
// inertial):
//
//   phi' = -C (b_g + n_g)    v' = -[C f x] phi - C (b_a + n_a) + G r    r' = v    b_g' = w_g    b_a' = w_a
//
// C is the rotation from P to N, G the gradient of a central gravitation. The covariance is propagated every
// `covariance_period_s`, by the integrals of C and C f over that time. An update takes the rows of a measurement one
// after another, in Joseph's form, which stays symmetric. The same bits on every machine; nothing here allocates,
// locks or throws; not thread-safe.
//
// An aid may have errors with a memory, which are estimated beside the states (Groves, section 3.4.3: noise of a
// measurement that is correlated in time augments the state):
//
//   e' = -e/T + w, of the variance s^2; or e' = w, a random walk
//
// Without such errors nothing of this is computed.
class InertialFilter {
 public:
  static constexpr int phi = 0, velocity = 3, position = 6, gyro_bias = 9, accelerometer_bias = 12, states = 15;
  static constexpr int most_aid_errors = 7;
  static constexpr double covariance_period_s = 0.02;
  using Covariance = Eigen::Matrix<double, states, states>;
  using State = Eigen::Matrix<double, states, 1>;
  using AidErrors = Eigen::Matrix<double, most_aid_errors, 1>;
  using CrossCovariance = Eigen::Matrix<double, states, most_aid_errors>;
  using AidCovariance = Eigen::Matrix<double, most_aid_errors, most_aid_errors>;

  // An error of an aid, in the unit of its measurement.
  struct AidError {
    double variance = 0;  // at the begin, not negative
    double rate = 0;      // 1/s, of its decay: 1/T; 0: a random walk
    double growth = 0;    // 1/s, of the variance: 2 s^2/T; not negative
    static AidError correlated(double sigma, double time_s) noexcept {
      return {sigma * sigma, 1 / time_s, 2 * sigma * sigma / time_s};
    }
    static AidError walk(double sigma, double density) noexcept { return {sigma * sigma, 0, density * density}; }
  };

  // `aid_errors`: most_aid_errors at most.
  InertialFilter(const GravitationModel& gravitation, const IncrementDefinitions& definitions,
                 const InertialNoise& noise, std::span<const AidError> aid_errors = {}) noexcept;

  const InertialState& motion() const noexcept { return strapdown_.state(); }
  const Vector3& gyro_bias_P() const noexcept { return gyro_bias_; }                    // rad/s
  const Vector3& accelerometer_bias_P() const noexcept { return accelerometer_bias_; }  // m/s^2
  // The covariance at the end of the last step for which it was propagated; symmetric.
  const Covariance& covariance() const noexcept { return P_; }
  const GravitationModel& gravitation() const noexcept { return strapdown_.gravitation(); }
  // The estimates of the aids' errors, their covariance, and the covariance of the states with them.
  const AidErrors& aid_errors() const noexcept { return e_; }
  const AidCovariance& aid_covariance() const noexcept { return D_; }
  const CrossCovariance& cross_covariance() const noexcept { return C_; }

  // Begins at a state and biases with that covariance. The aids' errors begin at 0, uncorrelated with all else.
  void begin(const InertialState& state, const Vector3& gyro_bias_P, const Vector3& accelerometer_bias_P,
             const Covariance& covariance) noexcept;
  // Correlates the vector that begins at state `first` with the aids' errors number `error` to `error` + 2, along the
  // rows of `axes_N`. The vector must have been set by a measurement with these errors, and its covariance must
  // already contain their variance.
  void begin_by(int first, const Matrix3& axes_N, int error) noexcept;
  // Integrates the increments of one step of `dt` s, above 0.
  void advance(const Vector3& delta_angle, const Vector3& delta_velocity, double dt) noexcept;
  // Propagates the covariance to the present.
  void propagate() noexcept;

  // A measurement of up to three components of one of the first three vectors of the state.
  struct Measurement {
    int first = position;                  // phi, velocity or position
    int rows = 3;                          // 1 to 3
    Matrix3 axes_N = Matrix3::Identity();  // row i: the direction of component i, in N
    Vector3 innovation = Vector3::Zero();  // measured less estimated, along those axes
    Vector3 variance = Vector3::Ones();    // of the measurement, above 0
    int error = -1;  // component i has the aid's error number error + i; -1: no component has one
  };
  // Returns the square of the innovation in units of its covariance, which has a chi-square distribution of as many
  // degrees of freedom as rows where the filter is consistent. propagate() must have been called.
  double normalized_square(const Measurement& measurement) const noexcept;
  // Corrects the state, and the aids' errors, by the measurement.
  void update(const Measurement& measurement) noexcept;
  // Turns the attitude about `axis_N`, a unit vector, by `angle`, rad, so that the attitude about this axis is set.
  // Its error about this axis has then the variance `variance`, rad^2, above 0, and no correlation with the other
  // states.
  void turn(const Vector3& axis_N, double angle, double variance) noexcept;
  // Adds `variance` to the variance of each component of the vector that begins at state `first`.
  void add_variance(int first, double variance) noexcept;
  // Adds `variance` to the variance of the vector's component along `axis_N`, a unit vector.
  void add_variance(int first, const Vector3& axis_N, double variance) noexcept {
    P_.block<3, 3>(first, first) += variance * (axis_N * axis_N.transpose());
  }
  // Adds `variance` to the variance of the aids' error number `error`.
  void add_aid_variance(int error, double variance) noexcept { D_(error, error) += variance; }

 private:
  struct Row {
    int first, error;
    Vector3 axis_N;
    double innovation, variance;
  };
  void decay_aid_errors(double t) noexcept;
  void update_row(const Row& row, State& change, AidErrors& aid_change) noexcept;

  Strapdown strapdown_;
  InertialNoise noise_;
  Vector3 gyro_bias_ = Vector3::Zero(), accelerometer_bias_ = Vector3::Zero();
  Covariance P_ = Covariance::Zero();
  std::array<AidError, most_aid_errors> aids_{};
  int aid_count_ = 0;  // of aids_ in use
  AidErrors e_ = AidErrors::Zero();
  CrossCovariance C_ = CrossCovariance::Zero();
  AidCovariance D_ = AidCovariance::Zero();
  // Sums since the last propagate():
  double time_s_ = 0;
  Matrix3 rotation_s_ = Matrix3::Zero();  // the integral of C
  Vector3 dv_N_ = Vector3::Zero();        // the integral of C f
  double turns2_s_ = 0;                   // rad^2/s, the integral of the square of the rate
};

}  // namespace imud
