#include "core/attitude.hpp"

#include <algorithm>
#include <cmath>

namespace imud {

Vector3 mrp_from_dcm(const Matrix3& dcm_BN) {
  // Shepperd's method: the largest of the four squared quaternion components is the divisor. (Eigen's own conversion
  // does the same, on the transposed matrix: its quaternion maps B components to N.)
  return mrp_from_quaternion(Quaternion(Matrix3(dcm_BN.transpose())));
}

Vector3 mrp_subtract(const Vector3& sigma_2N, const Vector3& sigma_1N) {
  Vector3 s2 = mrp_short(sigma_2N);
  const Vector3 s1 = mrp_short(sigma_1N);
  double n2 = s2.squaredNorm();
  const double n1 = s1.squaredNorm();
  double d = 1.0 + n1 * n2 + 2.0 * s1.dot(s2);
  if (d < 0.1) {  // near 360 deg in these sets; the other set of 2 is then far from it
    s2 = mrp_shadow(s2);
    n2 = s2.squaredNorm();
    d = 1.0 + n1 * n2 + 2.0 * s1.dot(s2);
  }
  return mrp_short(((1.0 - n1) * s2 - (1.0 - n2) * s1 + 2.0 * s2.cross(s1)) / d);
}

Vector3 right_jacobian(const Vector3& phi, const Vector3& v) {
  const auto even = elementary::even_series(phi.squaredNorm());
  const Vector3 cross = phi.cross(v);
  return v - even.versine * cross + even.cubic * phi.cross(cross);
}

Vector3 inverse_right_jacobian(const Vector3& phi, const Vector3& omega) {
  // I + 1/2 [phi x] + c [phi x]^2 with c = (1 - h cot h)/|phi|^2, h = |phi|/2. Without cancellation:
  // sin h - h cos h = h^3 (versine - cubic) and |phi|^2 sin h = 4 h^3 sinc.
  const auto half = elementary::even_series(0.25 * phi.squaredNorm());
  const double c = (half.versine - half.cubic) / (4.0 * half.sinc);
  const Vector3 cross = phi.cross(omega);
  return omega + 0.5 * cross + c * phi.cross(cross);
}

Matrix3 dcm_from_yaw_pitch_roll(double yaw, double pitch, double roll) {
  const auto [sy, cy] = elementary::sincos(yaw);
  const auto [sp, cp] = elementary::sincos(pitch);
  const auto [sr, cr] = elementary::sincos(roll);
  Matrix3 m;
  m << cp * cy, cp * sy, -sp,                                   //
      sr * sp * cy - cr * sy, sr * sp * sy + cr * cy, sr * cp,  //
      cr * sp * cy + sr * sy, cr * sp * sy - sr * cy, cr * cp;
  return m;
}

Vector3 yaw_pitch_roll_from_dcm(const Matrix3& m) {
  const double cos_pitch = std::sqrt(m(0, 0) * m(0, 0) + m(0, 1) * m(0, 1));
  return {elementary::atan2(m(0, 1), m(0, 0)), elementary::atan2(-m(0, 2), cos_pitch),
          elementary::atan2(m(1, 2), m(2, 2))};
}

double rotation_defect(const Matrix3& m) {
  if (m.determinant() < 0.0) return 2.0;
  return (m * m.transpose() - Matrix3::Identity()).cwiseAbs().maxCoeff();
}

}  // namespace imud
