// Strapdown: attitude, velocity and position by integration of the increments of gyros and accelerometers.
#pragma once

#include "core/earth/gravitation.hpp"
#include "core/imu.hpp"
#include "core/vector.hpp"

namespace imud {

// The motion of the platform P in the truth's frame N, which does not rotate. Where N is the Earth's, the Earth turns
// below N: the Earth's rate and the transport rate are in the gyros' increments, and no term here removes them.
struct InertialState {
  Quaternion q_NP = Quaternion::Identity();  // unit; v_N = q_NP * v_P
  Vector3 v_N = Vector3::Zero();             // m/s
  Vector3 r_N = Vector3::Zero();             // m
};

// The definitions of the increments that are integrated.
struct IncrementDefinitions {
  DeltaAngle delta_angle = DeltaAngle::rotation_vector;
  DeltaVelocity delta_velocity = DeltaVelocity::integral;
};

// Integrates in N (Groves, Principles of GNSS, Inertial, and Multisensor Integrated Navigation Systems, 2nd edition,
// section 5.2), with the corrections for coning and sculling by the increments of the step before (Savage, Strapdown
// Inertial Navigation Integration Algorithm Design, Journal of Guidance, Control, and Dynamics 21(1) and 21(2),
// 1998):
//
//   phi = d + d' x d/12                       where d is an integral of the rate; else phi = d
//   dv  = J(phi) v + (d' x v + v' x d)/12     J: the mean of the rotations over the step; where v is an integral of
//                                             the specific force in moving axes; d', v' are of the step before
//
// The memo's delta-velocity is taken to be in the axes at the end of the step. Double precision; the same bits on
// every machine. Nothing here allocates, locks or throws; not thread-safe.
class Strapdown {
 public:
  explicit Strapdown(const GravitationModel& gravitation, const IncrementDefinitions& definitions = {}) noexcept
      : gravitation_(gravitation), definitions_(definitions) {}

  const InertialState& state() const noexcept { return state_; }
  const GravitationModel& gravitation() const noexcept { return gravitation_; }

  // Sets the state, from which the next step begins; the attitude is made a unit quaternion.
  void begin(const InertialState& state) noexcept;
  // Changes the state between two steps: by a rotation vector in N, rad, and by m/s and m.
  void correct(const Vector3& phi_N, const Vector3& dv_N, const Vector3& dr_N) noexcept;

  // Integrates one step of `dt` s, above 0: the increments of the platform, rad and m/s. Returns the change of the
  // velocity without gravitation, in N.
  Vector3 advance(const Vector3& delta_angle, const Vector3& delta_velocity, double dt) noexcept;

 private:
  GravitationModel gravitation_;
  IncrementDefinitions definitions_;
  InertialState state_;
  Vector3 last_angle_ = Vector3::Zero(), last_velocity_ = Vector3::Zero();  // of the step before
  Vector3 last_change_N_ = Vector3::Zero();                                 // m/s, of the velocity
  bool has_last_ = false;
};

}  // namespace imud
