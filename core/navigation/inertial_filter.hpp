// InertialFilter: an error-state Kalman filter of a strapdown navigator, of 15 states, or of 21.
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
// The scale factors 1 + s of gyros and accelerometers may be estimated beside the states as well. The increments are
// corrected as (measured - b dt)/(1 + s), and the errors of s act as the ones of the biases do, times the rate w or
// the force f (i2Nav-WHU, KF-GINS 6b44ae7, gi_engine.cpp, imuCompensate() and insPropagation()):
//
//   phi' = ... - C diag(w) s_g    v' = ... - C diag(f) s_a    s' = w_s
//
// by the integrals of C diag(w) and C diag(f). Without such errors and scale factors nothing of this is computed.
class InertialFilter {
 public:
  static constexpr int phi = 0, velocity = 3, position = 6, gyro_bias = 9, accelerometer_bias = 12, states = 15;
  static constexpr int most_aid_errors = 7, scale_factors = 6, most_added = most_aid_errors + scale_factors;
  static constexpr double covariance_period_s = 0.02;
  using Covariance = Eigen::Matrix<double, states, states>;
  using State = Eigen::Matrix<double, states, 1>;
  // The states that are added to these: the errors of the aids, then the scale factors if they are estimated, of the
  // gyros and of the accelerometers. The rest is 0.
  using Added = Eigen::Matrix<double, most_added, 1>;
  using CrossCovariance = Eigen::Matrix<double, states, most_added>;
  using AddedCovariance = Eigen::Matrix<double, most_added, most_added>;

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

  // Standard deviations of the scale factors at the begin; 0: they are not estimated. In an hour each variance grows
  // by a hundredth of its first value (chosen), so that the estimates stay alive.
  struct ScaleSigmas {
    double gyro = 0, accelerometer = 0;
    bool operator==(const ScaleSigmas&) const = default;
  };
  static constexpr double scale_growth = 0.01 / 3600;  // 1/s

  // `aid_errors`: most_aid_errors at most.
  InertialFilter(const GravitationModel& gravitation, const IncrementDefinitions& definitions,
                 const InertialNoise& noise, std::span<const AidError> aid_errors = {}) noexcept;

  const InertialState& motion() const noexcept { return strapdown_.state(); }
  const Vector3& gyro_bias_P() const noexcept { return gyro_bias_; }                    // rad/s
  const Vector3& accelerometer_bias_P() const noexcept { return accelerometer_bias_; }  // m/s^2
  // The covariance at the end of the last step for which it was propagated; symmetric.
  const Covariance& covariance() const noexcept { return P_; }
  const GravitationModel& gravitation() const noexcept { return strapdown_.gravitation(); }
  struct AddedStates {
    const Added& estimates;
    const AddedCovariance& covariance;
    const CrossCovariance& cross_covariance;  // of the states with these
    int first_scale_factor;                   // its number among these
  };
  AddedStates added() const noexcept { return {e_, D_, C_, aid_count_}; }

  // Estimates the scale factors from now on, beginning at 0 where they were not estimated before. Scale factors that
  // are no longer estimated are forgotten; they count as noise in manoeuvres.
  void estimate_scale_factors(const ScaleSigmas& sigmas) noexcept;
  // Begins at a state and biases with that covariance. The added states begin at 0, uncorrelated with all else.
  void begin(const InertialState& state, const Vector3& gyro_bias_P, const Vector3& accelerometer_bias_P,
             const Covariance& covariance) noexcept;
  // Correlates the vector that begins at state `first` with the aids' errors number `error` to `error` + 2, along the
  // rows of `axes_N`. The vector must have been set by a measurement with these errors, and its covariance must
  // already contain their variance.
  void begin_by(int first, const Matrix3& axes_N, int error) noexcept;
  struct Step {
    Vector3 delta_angle, delta_velocity;
  };
  // Returns measured increments without the estimated errors of the sensors.
  Step corrected(const Vector3& delta_angle, const Vector3& delta_velocity, double dt) const noexcept {
    Step step = {delta_angle - dt * gyro_bias_, delta_velocity - dt * accelerometer_bias_};
    if (has_scale_factors()) {
      constexpr double least = 0.5;  // of 1 + s, so that no estimate makes the increments infinite; chosen
      step.delta_angle.array() /= (1 + e_.segment<3>(aid_count_).array()).max(least);
      step.delta_velocity.array() /= (1 + e_.segment<3>(aid_count_ + 3).array()).max(least);
    }
    return step;
  }
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
  // Corrects the state, and the added states, by the measurement.
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
  bool has_scale_factors() const noexcept { return added_count_ > aid_count_; }
  void set_scale_factors(int first, double sigma) noexcept;
  void propagate_added(double t) noexcept;
  void update_row(const Row& row, State& change, Added& added_change) noexcept;

  Strapdown strapdown_;
  InertialNoise noise_;
  Vector3 gyro_bias_ = Vector3::Zero(), accelerometer_bias_ = Vector3::Zero();
  Covariance P_ = Covariance::Zero();
  std::array<AidError, most_added> models_{};  // of the added states
  int aid_count_ = 0, added_count_ = 0;        // of models_ in use
  ScaleSigmas scale_sigmas_;
  Added e_ = Added::Zero();
  CrossCovariance C_ = CrossCovariance::Zero();
  AddedCovariance D_ = AddedCovariance::Zero();
  // Sums since the last propagate():
  double time_s_ = 0;
  Matrix3 rotation_s_ = Matrix3::Zero();                            // the integral of C
  Vector3 dv_N_ = Vector3::Zero();                                  // the integral of C f
  double turns2_s_ = 0;                                             // rad^2/s, the integral of the square of the rate
  Matrix3 turns_ = Matrix3::Zero(), velocities_ = Matrix3::Zero();  // the integrals of C diag(w) and C diag(f)
};

}  // namespace imud
