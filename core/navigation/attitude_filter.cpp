#include "core/navigation/attitude_filter.hpp"

#include <algorithm>
#include <cmath>

#include "core/navigation/covariance_update.hpp"
#include "core/numbers/elementary.hpp"

namespace imud {
namespace {}  // namespace

void AttitudeFilter::begin(const Quaternion& q_LP, const Covariance& covariance) noexcept {
  strapdown_.begin({.q_NP = q_LP});
  gyro_bias_.setZero();
  P_ = covariance;
  manoeuvre2_ = time_s_ = turns2_s_ = turn_ = 0;
  rotation_s_.setZero();
}

void AttitudeFilter::advance(const Vector3& delta_angle, const Vector3& delta_velocity, double dt) noexcept {
  const Matrix3 before = q_LP().toRotationMatrix();
  const Vector3 turn = delta_angle - dt * gyro_bias_;
  strapdown_.advance(turn, delta_velocity, dt);
  rotation_s_ += (0.5 * dt) * (before + q_LP().toRotationMatrix());
  turns2_s_ += turn.squaredNorm() / dt;
  turn_ += before.row(2).dot(turn);
  time_s_ += dt;
  constexpr double rounding_s = 1e-6;
  if (time_s_ > period_s - rounding_s) propagate();
}

void AttitudeFilter::propagate() noexcept {
  const double t = time_s_;
  const Vector3 dv_L = strapdown_.state().v_N;
  const Matrix3 bias = P_.block<3, 3>(gyro_bias, gyro_bias);
  const Matrix3 phi_bias =
      P_.block<3, 3>(phi, gyro_bias) - rotation_s_.lazyProduct(bias);  // of the attitude after the period
  Matrix3 angle = P_.block<3, 3>(phi, phi) - rotation_s_.lazyProduct(P_.block<3, 3>(gyro_bias, phi)) -
                  phi_bias.lazyProduct(rotation_s_.transpose());
  const InertialNoise& noise = tuning_.noise;
  constexpr double manoeuvre_s = InertialNoise::manoeuvre_s;
  const double acceleration2_s = (dv_L + t * Vector3(0, 0, tuning_.gravity)).squaredNorm() / t;
  angle.diagonal().array() += square(noise.gyro) * t + manoeuvre_s * (square(noise.gyro_scale) * turns2_s_ +
                                                                      square(noise.g_sensitivity) * acceleration2_s);
  // A rate that is constant in L moves from axis to axis of a platform that turns.
  const double walk = square(noise.gyro_walk) * t + manoeuvre_s * square(tuning_.unmodelled_rate) * turns2_s_;
  P_.block<3, 3>(phi, phi) = 0.5 * (angle + angle.transpose());
  P_.block<3, 3>(phi, gyro_bias) = phi_bias;
  P_.block<3, 3>(gyro_bias, phi) = phi_bias.transpose();
  P_.diagonal().segment<3>(gyro_bias).array() += walk;
  if (levels_)
    level(dv_L, t);
  else
    correct(State::Zero());  // the next period begins
  time_s_ = turns2_s_ = turn_ = 0;
  rotation_s_.setZero();
}

// Measures the rotation that turns the mean of the specific force upward. A force straight down has no such rotation.
void AttitudeFilter::level(const Vector3& dv_L, double t) noexcept {
  const double g = tuning_.gravity, force = dv_L.norm() / t;
  const double noise2 = square(tuning_.noise.accelerometer) / t;
  const double allowed = 3.0 * std::sqrt(square(tuning_.accelerometer_bias) + noise2) + gravity_of_place;
  const double excess = std::max(0.0, std::abs(force - g) - allowed);
  const double turning = std::min(turning_speed * std::abs(turn_) / t, largest_turn);
  const double now = square(excess) + square(turning);
  manoeuvre2_ = std::max(now, manoeuvre2_ + std::min(1.0, t / acceleration_s) * (now - manoeuvre2_));
  const double density = 2.0 * acceleration_s * (square(tuning_.acceleration) + manoeuvre2_);
  const double variance = (density / t + noise2) / square(g);
  const double across = dv_L.head<2>().norm();
  const double per_force = across > 0 ? elementary::atan2(across, -dv_L.z()) / across : 0;
  State change = State::Zero();
  update_component(P_, phi, Vector3::UnitX(), -per_force * dv_L.y(), variance, change);
  update_component(P_, phi, Vector3::UnitY(), per_force * dv_L.x(), variance, change);
  correct(change);
}

void AttitudeFilter::correct(const State& change) noexcept {
  const InertialState& motion = strapdown_.state();
  strapdown_.correct(change.segment<3>(phi), -motion.v_N, -motion.r_N);
  gyro_bias_ += change.segment<3>(gyro_bias);
}

void AttitudeFilter::turn(double angle, double variance) noexcept {
  const Vector3 down = Vector3::UnitZ();
  const Matrix3 R = exp(angle * down).toRotationMatrix();
  const InertialState motion = strapdown_.state();
  strapdown_.correct(angle * down, R * motion.v_N - motion.v_N, Vector3::Zero());
  rotation_s_ = R.lazyProduct(rotation_s_).eval();
  turn_and_forget(P_, phi, R, down, variance);
}

double AttitudeFilter::normalized_square(const Heading& heading) const noexcept {
  const double variance = heading.axis_L.dot(P_.block<3, 3>(phi, phi) * heading.axis_L) + heading.variance;
  return square(heading.innovation) / variance;
}

void AttitudeFilter::update(const Heading& heading) noexcept {
  State change = State::Zero();
  update_component(P_, phi, heading.axis_L, heading.innovation, heading.variance, change);
  strapdown_.correct(change.segment<3>(phi), Vector3::Zero(), Vector3::Zero());
  gyro_bias_ += change.segment<3>(gyro_bias);
}

}  // namespace imud
