#include "core/navigation/azimuth.hpp"

#include "core/numbers/elementary.hpp"

namespace imud {

bool has_azimuth(const Vector3& field_L) noexcept {
  constexpr double least = 1e-6;  // T
  return field_L.x() * field_L.x() + field_L.y() * field_L.y() >= least * least;
}

Vector3 horizontal_at(double azimuth) noexcept {
  const elementary::SinCos of = elementary::sincos(azimuth);
  return {of.cos, of.sin, 0.0};
}

std::optional<double> turn_to(const GivenHeading& given, const Quaternion& q_LP) noexcept {
  const Vector3 from = q_LP * given.ahead_P, to = horizontal_at(given.azimuth);
  constexpr double least2 = 1e-2;  // of its horizontal part
  if (from.x() * from.x() + from.y() * from.y() < least2) return std::nullopt;
  return elementary::atan2(from.x() * to.y() - from.y() * to.x(), from.x() * to.x() + from.y() * to.y());
}

InertialFilter::Measurement azimuth_measurement(const Vector3& measured_L, const Vector3& estimated_L,
                                                const Quaternion& q_LN, double sigma) noexcept {
  const Vector3 &to = measured_L, &from = estimated_L;
  InertialFilter::Measurement azimuth;
  azimuth.first = InertialFilter::phi;
  azimuth.rows = 1;
  const double slope = to.z() / (to.x() * to.x() + to.y() * to.y());
  azimuth.axes_N.row(0) = (q_LN.conjugate() * Vector3(-slope * to.x(), -slope * to.y(), 1)).transpose();
  azimuth.innovation[0] =
      elementary::atan2(from.x() * to.y() - from.y() * to.x(), from.x() * to.x() + from.y() * to.y());
  azimuth.variance[0] = sigma * sigma;
  return azimuth;
}

}  // namespace imud
