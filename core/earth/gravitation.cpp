#include "core/earth/gravitation.hpp"

#include <cmath>

#include "core/units.hpp"

namespace imud {
namespace {

// WGS 84 (NGA.STND.0036, table 3.1 and 3.5).
constexpr double gm = 3.986004418e14;  // m^3/s^2, with the atmosphere
using units::wgs84::a, units::wgs84::b, units::wgs84::f;
constexpr double omega = units::earth_rate;
constexpr double j2 = 1.08262982131e-3;
constexpr double e_squared = a * a * f * (2.0 - f);  // E^2, E being the linear eccentricity, m^2

// The functions q and q' of E/u, without their leading powers: q = (E/u)^3 q_3, q' = (E/u)^2 q_2.
struct SecondKind {
  double q_3 = 0, q_2 = 0;
};
constexpr SecondKind second_kind(double squared) {  // (E/u)^2
  constexpr int terms = 12;
  SecondKind sum;
  for (int n = terms; n >= 1; --n) {
    const double product = (2.0 * n + 1.0) * (2.0 * n + 3.0);
    sum.q_3 = 2.0 * n / product - squared * sum.q_3;
    sum.q_2 = 6.0 / product - squared * sum.q_2;
  }
  return sum;
}

Vector3 wgs84(const Vector3& r) noexcept {
  const double p2 = r.x() * r.x() + r.y() * r.y(), z2 = r.z() * r.z();
  // The ellipsoidal coordinates u and beta (reduced latitude).
  const double half = 0.5 * (p2 + z2 - e_squared);
  const double u2 = half + std::sqrt(half * half + e_squared * z2), u = std::sqrt(u2);
  const double v2 = u2 + e_squared, v = std::sqrt(v2);
  const double sin = r.z() / u, cos = std::sqrt(p2) / v;
  const double w = std::sqrt((u2 + e_squared * sin * sin) / v2);

  constexpr double at_b = e_squared / (b * b);
  constexpr double q0_3 = second_kind(at_b).q_3;  // q0 = (E/b)^3 q0_3
  const SecondKind q = second_kind(e_squared / u2);
  constexpr double rotation = omega * omega * a * a;
  const double along_u =
      -(gm / v2 + rotation / v2 * (b * b * b / u2) * (q.q_2 / q0_3) * (0.5 * sin * sin - 1.0 / 6)) / w;
  const double ratio = b / u;
  const double along_beta = rotation / v * (ratio * ratio * ratio * q.q_3 / q0_3) * sin * cos / w;
  // From the axes of u and beta to N.
  const double outward = (u / v * cos * along_u - sin * along_beta) / w;
  const double up = (sin * along_u + u / v * cos * along_beta) / w;
  const double p = std::sqrt(p2);
  const double scale = p > 0.0 ? outward / p : 0.0;
  return {scale * r.x(), scale * r.y(), up};
}

Vector3 central_and_j2(const Vector3& r) noexcept {
  const double r2 = r.squaredNorm(), s = 5.0 * r.z() * r.z() / r2;
  const double k = 1.5 * j2 * a * a / r2;
  return -gm / (r2 * std::sqrt(r2)) *
         Vector3(r.x() * (1.0 + k * (1.0 - s)), r.y() * (1.0 + k * (1.0 - s)), r.z() * (1.0 + k * (3.0 - s)));
}

}  // namespace

bool is_near_earth(const Vector3& r_N) noexcept { return r_N.squaredNorm() > 0.25 * a * a; }

Vector3 gravitation_N(const GravitationModel& model, const Vector3& r_N) noexcept {
  using Kind = GravitationModel::Kind;
  const bool is_near = is_near_earth(r_N);
  if (model.kind == Kind::constant || (model.kind == Kind::automatic && !is_near)) return {0.0, 0.0, model.constant};
  if (model.kind == Kind::none || !is_near) return Vector3::Zero();
  return model.kind == Kind::j2 ? central_and_j2(r_N) : wgs84(r_N);
}

}  // namespace imud
