// Attitude: MRPs, quaternions, direction cosine matrices and rotation vectors, and how they turn into one another.
//
// Conventions (frames: core/README.md). sigma_BN, dcm_BN: of B relative to N; v_B = dcm_BN * v_N. q_NB is the same
// attitude as a unit quaternion whose product maps components the other way, v_N = q_NB * v_B, so that
// q_NB2 = q_NB1 * exp(phi) where phi is the rotation vector from B1 to B2, the same in both axes.
// None of these has a dead zone near zero or a singularity, except where said.
#pragma once

#include "core/elementary.hpp"
#include "core/vector.hpp"

namespace imud {

// --- Modified Rodrigues parameters, sigma = e tan(angle/4), any norm
// -------------------------------------------------

// The other MRP of the same attitude, -sigma/|sigma|^2. Undefined for 0.
inline Vector3 mrp_shadow(const Vector3& sigma) { return -sigma / sigma.squaredNorm(); }

// The one of the two with norm <= 1.
inline Vector3 mrp_short(const Vector3& sigma) { return sigma.squaredNorm() > 1.0 ? mrp_shadow(sigma) : sigma; }

inline Quaternion quaternion_from_mrp(const Vector3& sigma) {
  const Vector3 s = mrp_short(sigma);
  const double n = s.squaredNorm();
  const double scale = 1.0 / (1.0 + n);
  return {(1.0 - n) * scale, 2.0 * scale * s.x(), 2.0 * scale * s.y(), 2.0 * scale * s.z()};
}

inline Vector3 mrp_from_quaternion(const Quaternion& q) {
  const double d = q.w() >= 0.0 ? 1.0 + q.w() : q.w() - 1.0;
  return q.vec() / d;
}

// --- Rotation vectors, phi = e * angle, rad
// --------------------------------------------------------------------------

// Memo Eq. 3, corrected (as typeset it puts 4 atan into the denominator): phi = sigma/|sigma| * 4 atan|sigma|.
inline Vector3 rotation_vector_from_mrp(const Vector3& sigma) {
  const Vector3 s = mrp_short(sigma);
  return 4.0 * elementary::atan_over_x(s.squaredNorm()) * s;
}

// The rotation vector of q, angle in [0, pi].
inline Vector3 log(const Quaternion& q) { return rotation_vector_from_mrp(mrp_from_quaternion(q)); }

// The quaternion of a rotation vector, however long.
inline Quaternion exp(const Vector3& phi) {
  const auto half = elementary::even_series(0.25 * phi.squaredNorm());
  const Vector3 v = (0.5 * half.sinc) * phi;
  return {half.cos, v.x(), v.y(), v.z()};
}

// The right Jacobian at phi: omega = right_jacobian(phi, d phi/dt), where omega is the rate of B in its own axes and
// q_NB = q_0 * exp(phi). With -phi, the mean of exp(s phi) * v over s from 0 to 1.
Vector3 right_jacobian(const Vector3& phi, const Vector3& v);

// Its inverse: d phi/dt = inverse_right_jacobian(phi, omega). (Bortz 1971.) |phi| < 2 pi.
Vector3 inverse_right_jacobian(const Vector3& phi, const Vector3& omega);

// --- Direction cosine matrices
// ---------------------------------------------------------------------------------------

// dcm_PB from 3-2-1 Euler angles, rad: M1(roll) M2(pitch) M3(yaw).
Matrix3 dcm_from_yaw_pitch_roll(double yaw, double pitch, double roll);

// And back: yaw and roll from -pi to pi, pitch from -pi/2 to pi/2.
Vector3 yaw_pitch_roll_from_dcm(const Matrix3& dcm_PB);

// How far m is from a rotation: the largest element of |m m^T - I|, or 2 if det(m) < 0.
double rotation_defect(const Matrix3& m);

}  // namespace imud
