#include "core/attitude.hpp"

#include <algorithm>
#include <cmath>

#include "core/units.hpp"

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

Vector3 roll_pitch_yaw_deviations(const Quaternion& q_LP, const Vector3& sigma_L) noexcept {
  const Vector3 ahead_L = q_LP * Vector3::UnitX();
  constexpr double least = 1e-3;  // of the cosine of the pitch
  const double horizontal = std::sqrt(ahead_L.x() * ahead_L.x() + ahead_L.y() * ahead_L.y());
  const bool has_yaw = horizontal > 0;
  const double cos_yaw = has_yaw ? ahead_L.x() / horizontal : 1, sin_yaw = has_yaw ? ahead_L.y() / horizontal : 0;
  const double cos_pitch = std::max(horizontal, least), sin_pitch = -ahead_L.z();
  const Vector3 variance = sigma_L.cwiseProduct(sigma_L);
  const double along = cos_yaw * cos_yaw * variance.x() + sin_yaw * sin_yaw * variance.y(),
               across = sin_yaw * sin_yaw * variance.x() + cos_yaw * cos_yaw * variance.y();
  const double roll = along / (cos_pitch * cos_pitch), yaw = variance.z() + sin_pitch * sin_pitch * roll;
  return Vector3(std::sqrt(roll), std::sqrt(across), std::sqrt(yaw)).cwiseMin(units::pi);
}

double rotation_defect(const Matrix3& m) {
  if (m.determinant() < 0.0) return 2.0;
  return (m * m.transpose() - Matrix3::Identity()).cwiseAbs().maxCoeff();
}

}  // namespace imud
