#include "core/navigation/strapdown.hpp"

#include "core/attitude.hpp"

namespace imud {

void Strapdown::begin(const InertialState& state) noexcept {
  state_ = state;
  state_.q_NP.normalize();
  has_last_ = false;
}

void Strapdown::correct(const Vector3& phi_N, const Vector3& dv_N, const Vector3& dr_N) noexcept {
  state_.q_NP = (exp(phi_N) * state_.q_NP).normalized();
  state_.v_N += dv_N;
  state_.r_N += dr_N;
}

Vector3 Strapdown::advance(const Vector3& delta_angle, const Vector3& delta_velocity, double dt) noexcept {
  if (!has_last_) {  // a step of constant rate and force
    last_angle_ = delta_angle;
    last_velocity_ = delta_velocity;
  }
  Vector3 phi = delta_angle;
  if (definitions_.delta_angle == DeltaAngle::integral) phi += last_angle_.cross(delta_angle) / 12.0;
  const Quaternion q_begin = state_.q_NP;
  state_.q_NP = (q_begin * exp(phi)).normalized();
  Vector3 dv_N;
  if (definitions_.delta_velocity == DeltaVelocity::integral) {
    const Vector3 sculling = (last_angle_.cross(delta_velocity) + last_velocity_.cross(delta_angle)) / 12.0;
    dv_N = q_begin * Vector3(right_jacobian(-phi, delta_velocity) + sculling);
  } else {
    dv_N = state_.q_NP * delta_velocity;
  }
  // The acceleration is taken as linear over the step; its slope is by the change from the step before.
  const Vector3 to_middle = state_.r_N + 0.5 * dt * state_.v_N;
  const Vector3 g_dt = dt * gravitation_N(gravitation_, to_middle);
  const Vector3 change = dv_N + g_dt;
  if (has_last_) state_.r_N -= dt / 12.0 * (change - last_change_N_);
  state_.r_N += dt * (state_.v_N + 0.5 * change);
  state_.v_N += change;
  last_angle_ = delta_angle;
  last_velocity_ = delta_velocity;
  last_change_N_ = change;
  has_last_ = true;
  return dv_N;
}

}  // namespace imud
