// The review of a Navigator that rejects fixes: whether its attitude can be right, and the new begin if it cannot.
#include <algorithm>

#include "core/attitude.hpp"
#include "core/navigation/navigator.hpp"
#include "core/units.hpp"

namespace imud {

void Navigator::review(const Sample& sample, const At& at, double dt) noexcept {
  const Navigation& fix = sample.navigation;
  if (!has_fix(sample)) {
    has_begun_ = false;
    other_attitude_.reset();
    return;
  }
  alignment_.add(sample.delta_angle, sample.delta_velocity, dt, sample.magnetic_field);
  const PositionVelocity now = in_N(fix, at);
  const auto measured = measure_attitude(now, sample);
  if (!measured) return;
  const Quaternion turn_N = (measured->q_NP * filter_.motion().q_NP.conjugate()).normalized();
  const Matrix3 axes = q_NL(now, fix).conjugate().toRotationMatrix();
  const Vector2 variance = measured->sigma.array().square();
  filter_.propagate();
  const double square = filter_.normalized_square({.first = InertialFilter::phi,
                                                   .axes_N = axes,
                                                   .innovation = axes * log(turn_N),
                                                   .variance = {variance.x(), variance.x(), variance.y()}});
  other_attitude_.reset();
  if (square > model_.gate) other_attitude_ = {turn_N, measured->sigma};
}

// A wrong velocity may come from a tilt, by the component of gravity, and the tilt from the bias of a gyro.
void Navigator::doubt(const Vector3& position, const Vector3& velocity_N) noexcept {
  const double time_s = std::max(rejecting_s_, model_.alignment_s);
  const double tilt2 =
      velocity_N.squaredNorm() / (units::standard_gravity * units::standard_gravity * time_s * time_s);
  filter_.add_variance(InertialFilter::position, position.squaredNorm());
  filter_.add_variance(InertialFilter::velocity, velocity_N.squaredNorm());
  filter_.add_variance(InertialFilter::phi, tilt2);
  filter_.add_variance(InertialFilter::gyro_bias, tilt2 / (time_s * time_s));
}

// The rotation that the filter has missed may come from a gyro whose bias has changed meanwhile.
void Navigator::begin_again(const PositionVelocity& measured, const Sample& sample, const At& at) noexcept {
  const auto [turn_N, sigma] = *other_attitude_;
  const double gyro_bias = log(turn_N).norm() / std::max(rejecting_s_, model_.alignment_s);
  begin_filter(measured, sample, at, (turn_N * filter_.motion().q_NP).normalized(), sigma, gyro_bias);
  remember_motion();
  used_ = aid::position | aid::velocity;
  ++fixes_.used;
}

}  // namespace imud
