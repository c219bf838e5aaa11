#include "core/navigation/inertial_filter.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <type_traits>

#include "core/navigation/covariance_update.hpp"
#include "core/numbers/elementary.hpp"

namespace imud {
namespace {

using Covariance = InertialFilter::Covariance;

Matrix3 cross_matrix(const Vector3& v) {
  Matrix3 m;
  m << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return m;
}

// The blocks of the transition matrix that are neither 0 nor the identity.
struct Transition {
  Matrix3 phi_gyro, v_phi, v_gyro, v_accelerometer, v_r, r_phi, r_gyro, r_accelerometer, same;
  double r_v;

  // Replaces P by the transition matrix times P.
  template <class Matrix>
  void apply(Matrix&& P) const {
    using Rows = Eigen::Matrix<double, 3, std::remove_reference_t<Matrix>::ColsAtCompileTime>;
    const Rows phi = P.template middleRows<3>(InertialFilter::phi),
               v = P.template middleRows<3>(InertialFilter::velocity),
               r = P.template middleRows<3>(InertialFilter::position),
               gyro = P.template middleRows<3>(InertialFilter::gyro_bias),
               accelerometer = P.template middleRows<3>(InertialFilter::accelerometer_bias);
    P.template middleRows<3>(InertialFilter::phi) += phi_gyro.lazyProduct(gyro);
    P.template middleRows<3>(InertialFilter::velocity) =
        same.lazyProduct(v) + v_phi.lazyProduct(phi) + v_gyro.lazyProduct(gyro) +
        v_accelerometer.lazyProduct(accelerometer) + v_r.lazyProduct(r);
    P.template middleRows<3>(InertialFilter::position) = same.lazyProduct(r) + r_v * v + r_phi.lazyProduct(phi) +
                                                         r_gyro.lazyProduct(gyro) +
                                                         r_accelerometer.lazyProduct(accelerometer);
  }
};

// The blocks by which the scale factors act on the states.
struct ScaleTransition {
  Matrix3 phi_gyro, v_gyro, v_accelerometer, r_gyro, r_accelerometer;

  // `turns`, `velocities`: the integrals of C diag(w) and C diag(f) over t.
  ScaleTransition(const Matrix3& turns, const Matrix3& velocities, const Matrix3& force, double t)
      : phi_gyro(-turns),
        v_gyro(0.5 * force * turns),
        v_accelerometer(-velocities),
        r_gyro((t / 6.0) * force * turns),
        r_accelerometer((-0.5 * t) * velocities) {}

  // Adds these blocks times the rows `S` of the scale factors to the rows `P` of the states.
  template <int Columns>
  void add(Eigen::Matrix<double, InertialFilter::states, Columns>& P,
           const Eigen::Matrix<double, InertialFilter::scale_factors, Columns>& S) const {
    const auto gyro = S.template topRows<3>(), accelerometer = S.template bottomRows<3>();
    P.template middleRows<3>(InertialFilter::phi) += phi_gyro.lazyProduct(gyro);
    P.template middleRows<3>(InertialFilter::velocity) +=
        v_gyro.lazyProduct(gyro) + v_accelerometer.lazyProduct(accelerometer);
    P.template middleRows<3>(InertialFilter::position) +=
        r_gyro.lazyProduct(gyro) + r_accelerometer.lazyProduct(accelerometer);
  }
};

// The gradient of the gravitation at r_N, 1/s^2, as of a sphere of that gravitation: within 0.3 % of the Earth's.
Matrix3 gravity_gradient(const Vector3& g_N, const Vector3& r_N) {
  if (!is_near_earth(r_N)) return Matrix3::Zero();
  const double r2 = r_N.squaredNorm();
  const double rate2 = std::sqrt(g_N.squaredNorm() / r2);
  return rate2 * (3.0 / r2 * r_N * r_N.transpose() - Matrix3::Identity());
}

}  // namespace

InertialFilter::InertialFilter(const GravitationModel& gravitation, const IncrementDefinitions& definitions,
                               const InertialNoise& noise, std::span<const AidError> aid_errors) noexcept
    : strapdown_(gravitation, definitions),
      noise_(noise),
      aid_count_(std::min(static_cast<int>(aid_errors.size()), most_aid_errors)),
      added_count_(aid_count_) {
  std::copy_n(aid_errors.begin(), aid_count_, models_.begin());
}

void InertialFilter::estimate_scale_factors(const ScaleSigmas& sigmas) noexcept {
  if (sigmas == scale_sigmas_) return;
  propagate();
  added_count_ = aid_count_ + (sigmas == ScaleSigmas{} ? 0 : scale_factors);
  if (sigmas.gyro != scale_sigmas_.gyro) set_scale_factors(aid_count_, sigmas.gyro);
  if (sigmas.accelerometer != scale_sigmas_.accelerometer) set_scale_factors(aid_count_ + 3, sigmas.accelerometer);
  scale_sigmas_ = sigmas;
}

void InertialFilter::set_scale_factors(int first, double sigma) noexcept {
  for (int i = first; i < first + 3; ++i) {
    const double variance = sigma * sigma;
    models_[static_cast<std::size_t>(i)] = {variance, 0, scale_growth * variance};
    e_[i] = 0;
    C_.col(i).setZero();
    D_.row(i).setZero();
    D_.col(i).setZero();
    D_(i, i) = variance;
  }
}

void InertialFilter::begin(const InertialState& state, const Vector3& gyro_bias_P,
                           const Vector3& accelerometer_bias_P, const Covariance& covariance) noexcept {
  strapdown_.begin(state);
  gyro_bias_ = gyro_bias_P;
  accelerometer_bias_ = accelerometer_bias_P;
  P_ = covariance;
  e_.setZero();
  C_.setZero();
  D_.setZero();
  for (int i = 0; i < added_count_; ++i) D_(i, i) = models_[static_cast<std::size_t>(i)].variance;
  time_s_ = turns2_s_ = 0;
  rotation_s_.setZero();
  dv_N_.setZero();
  turns_.setZero();
  velocities_.setZero();
}

// The vector is measured less its noise, so that its error, true less estimated, has the error of the aid with the
// other sign.
void InertialFilter::begin_by(int first, const Matrix3& axes_N, int error) noexcept {
  for (int i = 0; i < 3; ++i)
    C_.block<3, 1>(first, error + i) = -D_(error + i, error + i) * axes_N.row(i).transpose();
}

void InertialFilter::advance(const Vector3& delta_angle, const Vector3& delta_velocity, double dt) noexcept {
  const Matrix3 before = strapdown_.state().q_NP.toRotationMatrix();
  const Step step = corrected(delta_angle, delta_velocity, dt);
  dv_N_ += strapdown_.advance(step.delta_angle, step.delta_velocity, dt);
  const Matrix3 after = strapdown_.state().q_NP.toRotationMatrix();
  rotation_s_ += (0.5 * dt) * (before + after);
  if (has_scale_factors()) {
    const Matrix3 mean = 0.5 * (before + after);
    turns_ += mean * step.delta_angle.asDiagonal();
    velocities_ += mean * step.delta_velocity.asDiagonal();
  }
  turns2_s_ += delta_angle.squaredNorm() / dt;
  time_s_ += dt;
  constexpr double rounding_s = 1e-6;
  if (time_s_ > covariance_period_s - rounding_s) propagate();
}

void InertialFilter::propagate() noexcept {
  if (time_s_ == 0) return;
  const double t = time_s_;
  const Vector3 g_N = gravitation_N(gravitation(), motion().r_N);
  const Matrix3 gradient = gravity_gradient(g_N, motion().r_N), force = cross_matrix(dv_N_);
  const Matrix3 turned = force * rotation_s_;
  const Transition transition = {.phi_gyro = -rotation_s_,
                                 .v_phi = -force,
                                 .v_gyro = 0.5 * turned,
                                 .v_accelerometer = -rotation_s_,
                                 .v_r = t * gradient,
                                 .r_phi = (-0.5 * t) * force,
                                 .r_gyro = (t / 6.0) * turned,
                                 .r_accelerometer = (-0.5 * t) * rotation_s_,
                                 .same = Matrix3::Identity() + (0.5 * t * t) * gradient,
                                 .r_v = t};
  // With scale factors, x = F x + G s: P = (F P + G C^T) F^T + (F C + G D) G^T, and C = F C + G D.
  std::optional<ScaleTransition> scale;
  if (has_scale_factors()) scale.emplace(turns_, velocities_, force, t);
  transition.apply(P_);
  if (scale) scale->add<states>(P_, C_.middleCols<scale_factors>(aid_count_).transpose());
  P_.transposeInPlace();
  transition.apply(P_);
  if (scale) {
    transition.apply(C_);
    scale->add<most_added>(C_, D_.middleRows<scale_factors>(aid_count_));
    scale->add<states>(P_, C_.middleCols<scale_factors>(aid_count_).transpose());
    turns_.setZero();
    velocities_.setZero();
  } else if (added_count_ > 0) {
    transition.apply(C_.leftCols<most_aid_errors>());
  }
  if (added_count_ > 0) propagate_added(t);
  constexpr double manoeuvre_s = InertialNoise::manoeuvre_s;
  const double manoeuvre2_s = (dv_N_ + t * g_N).squaredNorm() / t;  // the integral of the squared acceleration
  const double gyro_scale = scale_sigmas_.gyro > 0 ? noise_.gyro_misalignment : noise_.gyro_scale,
               accelerometer_scale =
                   scale_sigmas_.accelerometer > 0 ? noise_.accelerometer_misalignment : noise_.accelerometer_scale;
  const double angle = square(noise_.gyro) * t +
                       manoeuvre_s * (square(gyro_scale) * turns2_s_ + square(noise_.g_sensitivity) * manoeuvre2_s),
               dv = square(noise_.accelerometer) * t + manoeuvre_s * square(accelerometer_scale) * manoeuvre2_s;
  const Matrix3 v_phi = (-0.5 * angle) * force;
  P_.block<3, 3>(velocity, phi) += v_phi;
  P_.block<3, 3>(phi, velocity) += v_phi.transpose();
  for (int i = 0; i < 3; ++i) {
    P_(phi + i, phi + i) += angle;
    P_(velocity + i, velocity + i) += dv;
    P_(velocity + i, position + i) += 0.5 * t * dv;
    P_(position + i, velocity + i) += 0.5 * t * dv;
    P_(position + i, position + i) += t * t / 3.0 * dv;
    P_(gyro_bias + i, gyro_bias + i) += noise_.gyro_walk * noise_.gyro_walk * t;
    P_(accelerometer_bias + i, accelerometer_bias + i) += noise_.accelerometer_walk * noise_.accelerometer_walk * t;
  }
  for (int i = 0; i < states; ++i)
    for (int j = 0; j < i; ++j) P_(i, j) = P_(j, i) = 0.5 * (P_(i, j) + P_(j, i));
  time_s_ = turns2_s_ = 0;
  rotation_s_.setZero();
  dv_N_.setZero();
}

void InertialFilter::propagate_added(double t) noexcept {
  for (int i = 0; i < added_count_; ++i) {
    const AidError& model = models_[static_cast<std::size_t>(i)];
    double added = model.growth * t;
    if (model.rate > 0) {
      const double left = elementary::exp(-t * model.rate);
      added = 0.5 * model.growth / model.rate * (1 - left * left);
      e_[i] *= left;
      C_.col(i) *= left;
      for (int j = 0; j < added_count_; ++j) {
        D_(i, j) *= left;
        D_(j, i) *= left;
      }
    }
    D_(i, i) += added;
  }
}

double InertialFilter::normalized_square(const Measurement& measurement) const noexcept {
  const Matrix3 block = P_.block<3, 3>(measurement.first, measurement.first);
  Matrix3 S = measurement.axes_N * block * measurement.axes_N.transpose();
  const bool has_error = measurement.error >= 0;
  if (has_error)
    for (int i = 0; i < measurement.rows; ++i)
      for (int j = 0; j < measurement.rows; ++j)
        S(i, j) += measurement.axes_N.row(i).dot(C_.block<3, 1>(measurement.first, measurement.error + j)) +
                   measurement.axes_N.row(j).dot(C_.block<3, 1>(measurement.first, measurement.error + i)) +
                   D_(measurement.error + i, measurement.error + j);
  // By Cholesky's decomposition S = K K^T: the square of K^-1 y, row by row.
  Matrix3 K = Matrix3::Zero();
  Vector3 z = Vector3::Zero();
  double sum = 0;
  for (int i = 0; i < measurement.rows; ++i) {
    S(i, i) += measurement.variance[i];
    double y = measurement.innovation[i];
    if (has_error) y -= e_[measurement.error + i];
    for (int j = 0; j <= i; ++j) {
      double s = S(i, j);
      for (int k = 0; k < j; ++k) s -= K(i, k) * K(j, k);
      K(i, j) = i == j ? std::sqrt(s) : s / K(j, j);
      if (j < i) y -= K(i, j) * z[j];
    }
    z[i] = y / K(i, i);
    sum += z[i] * z[i];
  }
  return sum;
}

void InertialFilter::update(const Measurement& measurement) noexcept {
  State change = State::Zero();
  Added added_change = Added::Zero();
  for (int i = 0; i < measurement.rows; ++i) {
    const bool has_error = measurement.error >= 0;
    const int error = has_error ? measurement.error + i : -1;
    update_row({.first = measurement.first,
                .error = error,
                .axis_N = measurement.axes_N.row(i).transpose(),
                .innovation = has_error ? measurement.innovation[i] - e_[error] : measurement.innovation[i],
                .variance = measurement.variance[i]},
               change, added_change);
  }
  strapdown_.correct(change.segment<3>(phi), change.segment<3>(velocity), change.segment<3>(position));
  gyro_bias_ += change.segment<3>(gyro_bias);
  accelerometer_bias_ += change.segment<3>(accelerometer_bias);
  e_ += added_change;
}

// correct() for the states and the added ones together.
void InertialFilter::update_row(const Row& row, State& change, Added& added_change) noexcept {
  const Vector3& axis_N = row.axis_N;
  const int first = row.first;
  State Ph = times_axis(P_, first, axis_N);
  if (row.error >= 0) Ph += C_.col(row.error);
  const auto along = [&](const State& x) { return along_axis(x, first, axis_N); };
  Added Dh = Added::Zero();  // of the added states, as Ph of the states
  for (int i = 0; i < added_count_; ++i) {
    Dh[i] = along(C_.col(i));
    if (row.error >= 0) Dh[i] += D_(i, row.error);
  }
  double s = along(Ph) + row.variance, innovation = row.innovation - along(change);
  if (row.error >= 0) {
    s += Dh[row.error];
    innovation -= added_change[row.error];
  }
  const State k = correct(P_, Ph, s);
  change += k * innovation;
  for (int j = 0; j < added_count_; ++j) {
    const double gain = Dh[j] / s;
    for (int i = 0; i < states; ++i) C_(i, j) += s * (k[i] * gain) - k[i] * Dh[j] - Ph[i] * gain;
    for (int i = 0; i <= j; ++i)
      D_(i, j) = D_(j, i) = D_(i, j) - Dh[i] / s * Dh[j] - Dh[i] * gain + s * (Dh[i] / s * gain);
    added_change[j] += gain * innovation;
  }
}

void InertialFilter::turn(const Vector3& axis_N, double angle, double variance) noexcept {
  propagate();
  strapdown_.correct(angle * axis_N, Vector3::Zero(), Vector3::Zero());
  const Matrix3 R = exp(angle * axis_N).toRotationMatrix();
  turn_and_forget(P_, phi, R, axis_N, variance);
  const Matrix3 kept = R - axis_N * axis_N.transpose();
  C_.middleRows<3>(phi) = kept.lazyProduct(C_.middleRows<3>(phi)).eval();
}

void InertialFilter::add_variance(int first, double variance) noexcept {
  for (int i = first; i < first + 3; ++i) P_(i, i) += variance;
}

}  // namespace imud
