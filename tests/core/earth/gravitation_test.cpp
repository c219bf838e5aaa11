// Gravitation against the published figures of WGS 84.
#include "core/earth/gravitation.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "core/earth/earth.hpp"
#include "core/units.hpp"

namespace imud {
namespace {

using Kind = GravitationModel::Kind;
constexpr GravitationModel normal_field{.kind = Kind::wgs84}, j2_field{.kind = Kind::j2};
constexpr double earth_omega = 7.292115e-5;

Vector3 place(double latitude, double longitude, double height) {
  EarthModel model;
  model.frame = EarthModel::Frame::local;
  model.latitude = latitude;
  model.longitude = longitude;
  model.height = height;
  return Earth(model).navigation({true, {}, Vector3::Zero(), Vector3::Zero()}).r_E;
}
Vector3 normal_gravity_at(const Vector3& r) {
  return gravitation_N(normal_field, r) + earth_omega * earth_omega * Vector3(r.x(), r.y(), 0);
}

// NGA.STND.0036, table 3.6: normal gravity at the equator and at the pole.
TEST(Gravitation, IsTheDocumentsAtEquatorAndPole) {
  const Vector3 equator = normal_gravity_at({0, 6'378'137.0, 0}), pole = normal_gravity_at({0, 0, -6'356'752.3142});
  EXPECT_NEAR(equator.y(), -9.7803253359, 1.5e-10);
  EXPECT_NEAR(pole.z(), 9.8321849379, 1.5e-10);
  EXPECT_TRUE(equator.x() == 0 && equator.z() == 0 && pole.x() == 0 && pole.y() == 0);
}

// The ellipsoid is a level surface: normal gravity is Somigliana's, along the vertical.
TEST(Gravitation, IsSomiglianasOnTheEllipsoid) {
  for (double latitude = -1.5; latitude <= 1.5; latitude += 0.25) {
    const Vector3 r = place(latitude, 0.7, 0);
    const Vector3 gravity_L = dcm_EL(latitude, 0.7).transpose() * normal_gravity_at(r);
    EXPECT_NEAR(gravity_L.z(), normal_gravity(latitude, 0), 3e-10) << latitude;
    EXPECT_LT(gravity_L.head<2>().norm(), 1e-8) << latitude;
    const Vector3 above = dcm_EL(latitude, 0.7).transpose() * normal_gravity_at(place(latitude, 0.7, 5'000));
    EXPECT_NEAR(above.z(), normal_gravity(latitude, 5'000), 1e-6) << latitude;
  }
}

// The zonal harmonics of the same field (NIMA TR8350.2, table 5.1: C20 to C10,0, fully normalised).
TEST(Gravitation, IsTheSumOfItsZonalHarmonics) {
  constexpr double gm = 3.986004418e14, a = 6'378'137.0;
  constexpr double c[] = {-0.484166774985e-3, 0.790303733511e-6, -0.168724961151e-8, 0.346052468394e-11,
                          -0.265002225747e-14};
  for (const double radius : {6.4e6, 6.8e6, 2.66e7, 4.2164e7})
    for (double latitude = -1.5; latitude <= 1.5; latitude += 0.3) {
      const double s = std::sin(latitude), cos = std::cos(latitude);
      double radial = 1, north = 0, j2_radial = 1, j2_north = 0, power = 1;
      double p_before = 1, p = s;  // Legendre polynomials of degree 0 and 1
      for (int n = 2, i = 0; n <= 10; ++n) {
        const double next = ((2 * n - 1) * s * p - (n - 1) * p_before) / n;
        p_before = p;
        p = next;
        if (n % 2 == 1) continue;
        power = std::pow(a / radius, n);
        const double slope = n * (p_before - s * p) / (cos * cos);  // dP/ds
        const double c_n = c[i++] * std::sqrt(2.0 * n + 1.0) * power;
        radial += (n + 1) * c_n * p;
        north += c_n * slope * cos;
        if (n == 2) j2_radial = radial, j2_north = north;
      }
      const Vector3 out(cos, 0, s), to_north(-s, 0, cos);
      const double central = gm / (radius * radius);
      const Vector3 r = radius * out;
      EXPECT_LT((gravitation_N(normal_field, r) - central * (north * to_north - radial * out)).norm(),
                1e-11 * central);
      EXPECT_LT((gravitation_N(j2_field, r) - central * (j2_north * to_north - j2_radial * out)).norm(),
                1e-12 * central);
    }
}

TEST(Gravitation, IsConstantOrNone) {
  const Vector3 r(1, 2, 3);
  EXPECT_EQ(gravitation_N({.kind = Kind::constant, .constant = 9.81}, r), Vector3(0, 0, 9.81));
  EXPECT_EQ(gravitation_N({.kind = Kind::none}, 7e6 * r), Vector3(0, 0, 0));
  EXPECT_EQ(gravitation_N(normal_field, r), Vector3(0, 0, 0)) << "inside of the Earth";
  EXPECT_EQ(gravitation_N({}, r), Vector3(0, 0, 9.80665)) << "a local level";
  EXPECT_EQ(gravitation_N({}, 7e6 * r), gravitation_N(normal_field, 7e6 * r));
  EXPECT_FALSE(is_near_earth(r));
  EXPECT_TRUE(is_near_earth(6.3e6 * Vector3::UnitX()));
}

}  // namespace
}  // namespace imud
