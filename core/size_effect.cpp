#include "core/size_effect.hpp"

#include "core/imu.hpp"
#include "core/numbers/dispatch.hpp"

namespace imud {

// Returns the vector whose component i is component i of a x rho_i; rho_i: the position of accelerometer i.
[[gnu::always_inline]] inline Lanes SizeEffect::cross(const Vector3& a) const noexcept {
  const Matrix3& rho = positions_;
  return Lanes{a[1], a[2], a[0]} * Lanes{rho(0, 2), rho(1, 0), rho(2, 1)} -
         Lanes{a[2], a[0], a[1]} * Lanes{rho(0, 1), rho(1, 2), rho(2, 0)};
}

// Returns the components i of omega x (omega x rho_i) = omega (omega . rho_i) - rho_i omega^2.
[[gnu::always_inline]] inline Lanes SizeEffect::centripetal(const Vector3& omega) const noexcept {
  return lanes(omega) * (lane_positions_ * omega) - omega.squaredNorm() * lanes(positions_.diagonal());
}

// Returns the time derivative of centripetal().
[[gnu::always_inline]] inline Lanes SizeEffect::centripetal_slope(const Vector3& omega,
                                                                  const Vector3& omega_dot) const noexcept {
  return lanes(omega_dot) * (lane_positions_ * omega) + lanes(omega) * (lane_positions_ * omega_dot) -
         2.0 * omega.dot(omega_dot) * lanes(positions_.diagonal());
}

// Integrates by the corrected trapezoidal rule (Imu::add_piece).
IMUD_DISPATCHED void SizeEffect::add_piece(const MotionState& begin, const MotionState& end, double h) noexcept {
  const Vector3 omega1 = in_P(begin.omega_BN_B), omega2 = in_P(end.omega_BN_B);
  const Lanes slope1 = centripetal_slope(omega1, in_P(begin.omegaDot_BN_B));
  const Lanes slope2 = centripetal_slope(omega2, in_P(end.omegaDot_BN_B));
  centripetal_sum_.add((0.5 * h) * (centripetal(omega1) + centripetal(omega2)) + (h * h / 12.0) * (slope1 - slope2));
}

IMUD_DISPATCHED void SizeEffect::add_to_values(const MotionState& now, Vector3& values) const noexcept {
  values = vector_of(lanes(values) + (cross(in_P(now.omegaDot_BN_B)) + centripetal(in_P(now.omega_BN_B))));
}

IMUD_DISPATCHED Vector3 SizeEffect::increments(const MotionBegin& last, const MotionState& now,
                                               DeltaVelocity definition) const noexcept {
  const Vector3 omega1 = in_P(last.omega_BN_B), omega2 = in_P(now.omega_BN_B);
  if (definition == DeltaVelocity::end_frame) {
    // The velocity omega x rho_i at the begin, in the axes of the end.
    const Matrix3 dcm_21 = dcm_PB_ * (now.q_NB.conjugate() * last.q_NB).toRotationMatrix() * dcm_PB_.transpose();
    Vector3 change = vector_of(cross(omega2));
    for (int i = 0; i < 3; ++i) change[i] -= dcm_21.row(i).dot(omega1.cross(Vector3(positions_.row(i))));
    return change;
  }
  const Lanes change = cross(omega2 - omega1);
  return vector_of(definition == DeltaVelocity::integral ? change + centripetal_sum_.lanes() : change);
}

}  // namespace imud
