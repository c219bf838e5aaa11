// Attitude: conversions between MRPs, quaternions, direction cosine matrices and rotation vectors.
//
// Conventions (the frames stand in core/README.md): sigma_BN is the MRP of B relative to N, v_B = dcm_BN * v_N. q_NB
// is the same attitude as a unit quaternion whose product maps components the other way, v_N = q_NB * v_B. Hence
// q_NB2 = q_NB1 * exp(phi), where phi is the rotation vector from B1 to B2; its components are the same in both axes.
//
// All functions are pure and thread-safe, do not allocate or throw, and give the same bits on every machine. They
// have no dead zone near zero and no singularity except where stated. Angles are in rad.
#pragma once

#include "core/numbers/elementary.hpp"
#include "core/vector.hpp"

namespace imud {

// --- Modified Rodrigues parameters: sigma = e tan(angle/4), of any norm
// (Schaub and Junkins, Analytical Mechanics of Space Systems, section 3.5)

// Returns the other MRP of the same attitude, -sigma/|sigma|^2. `sigma` must not be 0.
inline Vector3 mrp_shadow(const Vector3& sigma) { return -sigma / sigma.squaredNorm(); }

// Returns whichever MRP of the same attitude has a norm of at most 1.
inline Vector3 mrp_short(const Vector3& sigma) { return sigma.squaredNorm() > 1.0 ? mrp_shadow(sigma) : sigma; }

// Returns q_NB of sigma_BN, of unit length, with w >= 0.
inline Quaternion quaternion_from_mrp(const Vector3& sigma) {
  const Vector3 s = mrp_short(sigma);
  const double n = s.squaredNorm();
  const double scale = 1.0 / (1.0 + n);
  return {(1.0 - n) * scale, 2.0 * scale * s.x(), 2.0 * scale * s.y(), 2.0 * scale * s.z()};
}

// Returns sigma_BN of the unit quaternion q_NB, of either sign; its norm is at most 1.
inline Vector3 mrp_from_quaternion(const Quaternion& q) {
  const double d = q.w() >= 0.0 ? 1.0 + q.w() : q.w() - 1.0;
  return q.vec() / d;
}

// --- Rotation vectors: phi = e * angle

// Returns phi = sigma/|sigma| * 4 atan|sigma|, its angle in [0, pi]. (Memo Eq. 3, corrected: as typeset it has 4 atan
// in the denominator.)
inline Vector3 rotation_vector_from_mrp(const Vector3& sigma) {
  const Vector3 s = mrp_short(sigma);
  return 4.0 * elementary::atan_over_x(s.squaredNorm()) * s;
}

// Returns the rotation vector of the unit quaternion q, of either sign; its angle is in [0, pi].
inline Vector3 log(const Quaternion& q) { return rotation_vector_from_mrp(mrp_from_quaternion(q)); }

// Returns the unit quaternion of a rotation vector of any length (see elementary::sincos for the accuracy beyond
// 1e5).
inline Quaternion exp(const Vector3& phi) {
  const auto half = elementary::even_series(0.25 * phi.squaredNorm());
  const Vector3 v = (0.5 * half.sinc) * phi;
  return {half.cos, v.x(), v.y(), v.z()};
}

// Applies the right Jacobian at phi: where q_NB = q_0 * exp(phi), the rate of B in its own axes is
// omega = right_jacobian(phi, d phi/dt). The mean of exp(s phi) * v over s in [0, 1] is right_jacobian(-phi, v).
inline Vector3 right_jacobian(const Vector3& phi, const Vector3& v) {
  const auto even = elementary::even_series(phi.squaredNorm());
  const Vector3 cross = phi.cross(v);
  return v - even.versine * cross + even.cubic * phi.cross(cross);
}

// Applies the inverse of the right Jacobian: d phi/dt = inverse_right_jacobian(phi, omega), for |phi| < 2 pi. (J. E.
// Bortz, IEEE Transactions on Aerospace and Electronic Systems 7(1), 1971.)
inline Vector3 inverse_right_jacobian(const Vector3& phi, const Vector3& omega) {
  // I + 1/2 [phi x] + c [phi x]^2 with c = (1 - h cot h)/|phi|^2, h = |phi|/2. Without cancellation:
  // sin h - h cos h = h^3 (versine - cubic) and |phi|^2 sin h = 4 h^3 sinc.
  const auto half = elementary::even_series(0.25 * phi.squaredNorm());
  const double c = (half.versine - half.cubic) / (4.0 * half.sinc);
  const Vector3 cross = phi.cross(omega);
  return omega + 0.5 * cross + c * phi.cross(cross);
}

// --- Direction cosine matrices

// Returns dcm_PB = M1(roll) M2(pitch) M3(yaw) of 3-2-1 Euler angles.
Matrix3 dcm_from_yaw_pitch_roll(double yaw, double pitch, double roll);

// Returns {yaw, pitch, roll} of dcm_PB: yaw and roll in [-pi, pi], pitch in [-pi/2, pi/2]. At a pitch of +-pi/2 yaw
// and roll are not unique.
Vector3 yaw_pitch_roll_from_dcm(const Matrix3& dcm_PB);

// Returns the standard deviations of roll, pitch and yaw, rad, pi at most, of an attitude whose error is a rotation
// with the standard deviations `sigma_L` about north, east and down, rad, that are not correlated:
//   roll' = (cos yaw N + sin yaw E)/cos pitch    pitch' = cos yaw E - sin yaw N    yaw' = D + sin pitch roll'
// v_L = q_LP * v_P. The cosine of the pitch counts as 0.001 at least.
Vector3 roll_pitch_yaw_deviations(const Quaternion& q_LP, const Vector3& sigma_L) noexcept;

// Returns the deviation of m from a rotation: the largest element of |m m^T - I|, or 2 if det(m) < 0.
double rotation_defect(const Matrix3& m);

}  // namespace imud
