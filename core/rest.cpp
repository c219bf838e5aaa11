#include "core/rest.hpp"

#include "core/attitude.hpp"
#include "core/numbers/elementary.hpp"
#include "core/units.hpp"

namespace imud {
namespace {
EarthModel fixed_to_ground(EarthModel model) {
  const bool is_unknown = model.frame == EarthModel::Frame::automatic && !model.is_rest_known;
  if (is_unknown) model.frame = EarthModel::Frame::none;
  if (model.frame != EarthModel::Frame::none) model.frame = EarthModel::Frame::local;
  return model;
}
}  // namespace

Rest::Rest(const EarthModel& model) : earth_(fixed_to_ground(model)) {
  const Vector3& angles = model.rest_yaw_pitch_roll;
  const Matrix3 dcm_BL = dcm_from_yaw_pitch_roll(angles[0], angles[1], angles[2]);
  q_LB_ = Quaternion(Matrix3(dcm_BL.transpose())).normalized();
  const auto [sin, cos] = elementary::sincos(model.latitude);
  const double rate = earth_.is_on() ? units::earth_rate : 0.0;
  const double gravity = earth_.is_on() ? normal_gravity(model.latitude, model.height) : units::standard_gravity;
  omega_BN_B_ = dcm_BL * Vector3(rate * cos, 0.0, -rate * sin);
  specific_force_B_ = dcm_BL * Vector3(0.0, 0.0, -gravity);
}

MotionState Rest::at(TruthTime time, TruthTime aligned) const noexcept {
  const double elapsed = seconds(time - aligned);
  const Vector3 phi = elapsed * omega_BN_B_;
  MotionState state;
  state.time = time;
  state.q_NB = q_LB_ * exp(phi);
  state.omega_BN_B = omega_BN_B_;
  state.specific_force_B = specific_force_B_;
  state.dv_N = elapsed * (q_LB_ * right_jacobian(-phi, specific_force_B_));
  return state;
}

}  // namespace imud
