#include "core/attitude.hpp"

#include <cmath>

namespace imud {

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
