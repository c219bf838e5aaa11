// InertialFilter: an error-state Kalman filter of a strapdown navigator, of 15 states.
#pragma once

#include <Eigen/Core>

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
class InertialFilter {
 public:
  static constexpr int phi = 0, velocity = 3, position = 6, gyro_bias = 9, accelerometer_bias = 12, states = 15;
  static constexpr double covariance_period_s = 0.02;
  using Covariance = Eigen::Matrix<double, states, states>;
  using State = Eigen::Matrix<double, states, 1>;

  InertialFilter(const GravitationModel& gravitation, const IncrementDefinitions& definitions,
                 const InertialNoise& noise) noexcept
      : strapdown_(gravitation, definitions), noise_(noise) {}

  const InertialState& motion() const noexcept { return strapdown_.state(); }
  const Vector3& gyro_bias_P() const noexcept { return gyro_bias_; }                    // rad/s
  const Vector3& accelerometer_bias_P() const noexcept { return accelerometer_bias_; }  // m/s^2
  // The covariance at the end of the last step for which it was propagated; symmetric.
  const Covariance& covariance() const noexcept { return P_; }
  const GravitationModel& gravitation() const noexcept { return strapdown_.gravitation(); }

  // Begins at a state and biases with that covariance.
  void begin(const InertialState& state, const Vector3& gyro_bias_P, const Vector3& accelerometer_bias_P,
             const Covariance& covariance) noexcept;
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
  };
  // Returns the square of the innovation in units of its covariance, which has a chi-square distribution of as many
  // degrees of freedom as rows where the filter is consistent. propagate() must have been called.
  double normalized_square(const Measurement& measurement) const noexcept;
  // Corrects the state by the measurement.
  void update(const Measurement& measurement) noexcept;
  // Adds to the variance of one of the vectors, isotropically.
  void add_variance(int first, double variance) noexcept;

 private:
  void update_row(int first, const Vector3& axis_N, double innovation, double variance, State& change) noexcept;

  Strapdown strapdown_;
  InertialNoise noise_;
  Vector3 gyro_bias_ = Vector3::Zero(), accelerometer_bias_ = Vector3::Zero();
  Covariance P_ = Covariance::Zero();
  // Since the last propagate():
  double time_s_ = 0;
  Matrix3 rotation_s_ = Matrix3::Zero();  // the integral of C
  Vector3 dv_N_ = Vector3::Zero();        // the integral of C f
  double turns2_s_ = 0;                   // rad^2/s, the integral of the square of the rate
};

}  // namespace imud
