#include "core/size_effect.hpp"

#include "core/imu.hpp"

namespace imud {

// Returns the components i of a x rho_i.
Vector3 SizeEffect::cross(const Vector3& a) const noexcept {
  Vector3 all;
  for (int i = 0; i < 3; ++i) all[i] = a.cross(Vector3(positions_.row(i)))[i];
  return all;
}

// Returns the components i of omega x (omega x rho_i) = omega (omega . rho_i) - rho_i omega^2.
Vector3 SizeEffect::centripetal(const Vector3& omega) const noexcept {
  return omega.cwiseProduct(positions_ * omega) - omega.squaredNorm() * positions_.diagonal();
}

// Returns the derivative of the above with respect to time.
Vector3 SizeEffect::centripetal_slope(const Vector3& omega, const Vector3& omega_dot) const noexcept {
  return omega_dot.cwiseProduct(positions_ * omega) + omega.cwiseProduct(positions_ * omega_dot) -
         2.0 * omega.dot(omega_dot) * positions_.diagonal();
}

// The corrected trapezoidal rule (Imu::add_piece).
void SizeEffect::add_piece(const MotionState& begin, const MotionState& end, double h) noexcept {
  const Vector3 omega1 = dcm_PB_ * begin.omega_BN_B, omega2 = dcm_PB_ * end.omega_BN_B;
  const Vector3 slope1 = centripetal_slope(omega1, dcm_PB_ * begin.omegaDot_BN_B);
  const Vector3 slope2 = centripetal_slope(omega2, dcm_PB_ * end.omegaDot_BN_B);
  centripetal_sum_ += (0.5 * h) * (centripetal(omega1) + centripetal(omega2)) + (h * h / 12.0) * (slope1 - slope2);
}

void SizeEffect::add_to_values(const MotionState& now, Vector3& values) const noexcept {
  values += cross(dcm_PB_ * now.omegaDot_BN_B) + centripetal(dcm_PB_ * now.omega_BN_B);
}

Vector3 SizeEffect::increments(const MotionBegin& last, const MotionState& now,
                               DeltaVelocity definition) const noexcept {
  const Vector3 omega1 = dcm_PB_ * last.omega_BN_B, omega2 = dcm_PB_ * now.omega_BN_B;
  if (definition == DeltaVelocity::end_frame) {
    // The velocity omega x rho_i at the begin, in the axes of the end.
    const Matrix3 dcm_21 = dcm_PB_ * (now.q_NB.conjugate() * last.q_NB).toRotationMatrix() * dcm_PB_.transpose();
    Vector3 change = cross(omega2);
    for (int i = 0; i < 3; ++i) change[i] -= dcm_21.row(i).dot(omega1.cross(Vector3(positions_.row(i))));
    return change;
  }
  const Vector3 change = cross(omega2 - omega1);
  return definition == DeltaVelocity::integral ? Vector3(change + centripetal_sum_) : change;
}

}  // namespace imud
