// Earth: places, magnetic field and pressure against published figures.
#include "core/earth/earth.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "core/attitude.hpp"
#include "core/gps_time.hpp"
#include "core/imu.hpp"
#include "core/units.hpp"

namespace imud {
namespace {

using namespace std::chrono_literals;
constexpr double degree = units::degree;
constexpr std::int64_t start_2025 = 1'735'689'600;  // UTC, s since 1970

EarthModel local(double latitude_deg, double longitude_deg, double height) {
  EarthModel model;
  model.frame = EarthModel::Frame::local;
  model.latitude = latitude_deg * degree;
  model.longitude = longitude_deg * degree;
  model.height = height;
  model.start_gps_ns = gps_ns_from_unix(start_2025);
  return model;
}
EarthModel inertial(double angle = 0) {
  EarthModel model;
  model.frame = EarthModel::Frame::inertial;
  model.angle = angle;
  model.start_gps_ns = gps_ns_from_unix(start_2025);
  return model;
}

// IERS Conventions 2010, Eq. 5.15: 280.46 deg at 2000-01-01 12:00 UT1.
TEST(Earth, Times) {
  EXPECT_NEAR(earth_rotation_angle(946'728'000) / degree, 280.46061837, 1e-8);
  EXPECT_NEAR(earth_rotation_angle(946'728'000 + 86'400) / degree, 280.46061837 + 0.98561228809, 1e-8);
  EXPECT_EQ(decimal_year(gps_ns_from_unix(start_2025)), 2025);
  EXPECT_EQ(decimal_year(gps_ns_from_unix(start_2025 - 366 * 86'400 / 4)), 2024.75) << "2024 has 366 days";
  const double sidereal_day_s = 86'164.0989;
  EXPECT_NEAR(units::earth_rate * sidereal_day_s, 2 * units::pi, 1e-6);
}

// The ellipsoid's own axes, and 45 deg (a sqrt(1/2)/sqrt(1 - e2/2), with (1 - e2) in z).
TEST(Earth, GeodeticAndCartesian) {
  const PositionVelocity there = {true, {}, Vector3::Zero(), Vector3::Zero()};
  EXPECT_TRUE(Earth(local(0, 90, 0)).navigation(there).r_E.isApprox(Vector3(0, 6'378'137.0, 0), 1e-15));
  EXPECT_TRUE(Earth(local(90, 0, 0)).navigation(there).r_E.isApprox(Vector3(0, 0, 6'356'752.314245), 1e-12));
  EXPECT_LT(
      (Earth(local(45, 0, 0)).navigation(there).r_E - Vector3(4'517'590.87884893, 0, 4'487'348.40886592)).norm(),
      1e-6);
  for (const double height : {-400.0, 0.0, 10'000.0, 400e3, 36'000e3})
    for (double latitude = -90; latitude <= 90; latitude += 7.5)
      for (double longitude = -180; longitude < 180; longitude += 45) {
        const Navigation navigation = Earth(local(latitude, longitude, height)).navigation(there);
        ASSERT_TRUE(navigation.is_known);
        EXPECT_NEAR(navigation.latitude, latitude * degree, 1e-12) << latitude << ' ' << height;
        const double off = std::remainder(navigation.longitude - longitude * degree, 2 * units::pi);
        EXPECT_NEAR(std::abs(latitude) < 90 ? off : 0, 0, 1e-12);
        EXPECT_NEAR(navigation.height, height, 1e-7);
      }
}

TEST(Earth, NothingIsKnownWithoutFrameOrPosition) {
  EXPECT_FALSE(Earth(EarthModel{}).is_on());
  EXPECT_FALSE(Earth(EarthModel{}).navigation({true, {}, {7e6, 0, 0}, Vector3::Zero()}).is_known);
  EXPECT_FALSE(Earth(inertial()).navigation({false, {}, {7e6, 0, 0}, Vector3::Zero()}).is_known);
  EXPECT_FALSE(Earth(inertial()).navigation({true, {}, Vector3::Zero(), Vector3::Zero()}).is_known)
      << "in the Earth's centre";
  EXPECT_TRUE(Earth(inertial()).navigation({true, {}, {7e6, 0, 0}, Vector3::Zero()}).is_known);
}

// A vehicle that stands on the equator of the rotating Earth.
TEST(Earth, AnInertialFrameTurnsUnderneath) {
  const Earth earth(inertial(0.3));
  const TruthTime time{1'000'000'000'000};
  const double angle = 0.3 + 1000 * units::earth_rate;
  const Vector3 r(6'378'137.0 * std::cos(angle + 0.5), 6'378'137.0 * std::sin(angle + 0.5), 0);
  const Navigation navigation = earth.navigation({true, time, r, Vector3(0, 0, units::earth_rate).cross(r)});
  EXPECT_NEAR(navigation.longitude, 0.5, 1e-12);
  EXPECT_NEAR(navigation.height, 0, 1e-6);
  EXPECT_LT(navigation.v_L.norm(), 1e-9);
  EXPECT_EQ(navigation.gps_ns, gps_ns_from_unix(start_2025) + time.ns);
  // North is N's z; down points to the centre.
  const Quaternion q = earth.q_LN({true, time, r, Vector3::Zero()}, navigation);
  EXPECT_LT((q * Vector3::UnitZ() - Vector3::UnitX()).norm(), 1e-12);
  EXPECT_LT((q * Vector3(-r.normalized()) - Vector3::UnitZ()).norm(), 1e-12);
  // A vehicle that flies east in N at 100 m/s above that point.
  const Vector3 east(-std::sin(angle + 0.5), std::cos(angle + 0.5), 0);
  const Vector3 v = earth.navigation({true, time, r, Vector3(0, 0, units::earth_rate).cross(r) + 100 * east}).v_L;
  EXPECT_LT((v - Vector3(0, 100, 0)).norm(), 1e-9);
}

TEST(Earth, APlaceHasItsPositionInN) {
  EarthModel level;
  level.frame = EarthModel::Frame::local;
  level.latitude = 0.8;
  level.longitude = -1.2;
  const auto expect_inverse = [](const Earth& earth, const PositionVelocity& position) {
    const Navigation place = earth.navigation(position);
    ASSERT_TRUE(place.is_known);
    const PositionVelocity again = earth.position_velocity(place, position.time, position.earth_angle);
    EXPECT_TRUE(again.is_known);
    EXPECT_LT((again.r_N - position.r_N).norm(), 1e-8);
    EXPECT_LT((again.v_N - position.v_N).norm(), 1e-10);
  };
  const TruthTime time{70'000'000'000};
  const Vector3 far = r_E_of({0.81, -1.19, 700}), v(10, 200, -30);
  expect_inverse(Earth(inertial(0.3)), {true, time, far, v});
  expect_inverse(Earth(inertial(0.3)), {true, time, far, v, 1.5});
  expect_inverse(Earth(level), {true, time, {3000, -2000, -500}, v});
}

// A position that has the Earth's angle is at its own place, whatever the model's frame; an automatic frame knows no
// other.
TEST(Earth, TheTruthsOwnAngleHasPrecedence) {
  const Vector3 r(6'378'137.0 * std::cos(0.5), 6'378'137.0 * std::sin(0.5), 0);
  const PositionVelocity relative{true, {}, r, Vector3::Zero()};
  PositionVelocity own = relative;
  own.earth_angle = 0.1;
  EarthModel automatic;
  automatic.frame = EarthModel::Frame::automatic;
  EXPECT_FALSE(Earth(automatic).navigation(relative).is_known);
  EXPECT_FALSE(Earth(EarthModel{}).navigation(own).is_known) << "none";
  for (const EarthModel& model : {automatic, inertial(0.3), local(47, 11, 500)}) {
    const Earth earth(model);
    const Navigation navigation = earth.navigation(own);
    ASSERT_TRUE(navigation.is_known);
    EXPECT_NEAR(navigation.longitude, 0.4, 1e-12);
    EXPECT_NEAR(navigation.height, 0, 1e-6);
    EXPECT_LT((earth.q_LN(own, navigation) * Vector3(-r.normalized()) - Vector3::UnitZ()).norm(), 1e-12);
  }
  // Two angles that are the same but for rounding: that of the configuration is used.
  EXPECT_EQ(Earth(inertial(0.1 + 1e-6)).navigation(own).r_E, Earth(inertial(0.1 + 1e-6)).navigation(relative).r_E);
  EXPECT_EQ(Earth(inertial(0.1 + 1e-6 + 2 * units::pi)).navigation(relative).r_E,
            Earth(inertial(0.1 + 1e-6 + 2 * units::pi)).navigation(own).r_E);
  EXPECT_NEAR(angle_between(0.1, 2 * units::pi), 0.1, 1e-14);
  EXPECT_NEAR(angle_between(-3.0, 3.0), 2 * units::pi - 6, 1e-15);
}

TEST(Earth, ALocalFrameIsTheGroundsOwn) {
  const Earth earth(local(47, 11, 500));
  const Navigation navigation = earth.navigation({true, {}, {1000, 0, -200}, {30, -4, 5}});
  EXPECT_NEAR((navigation.latitude - 47 * degree) * 6'367'000, 1000, 3);
  EXPECT_NEAR(navigation.height, 700 + 1000.0 * 1000.0 / 2 / 6'370'000, 0.01) << "the ground falls away";
  EXPECT_LT((navigation.v_L - Vector3(30, -4, 5)).norm(), 0.01);
  EXPECT_LT(earth.q_LN({}, navigation).angularDistance(Quaternion::Identity()), 2e-4);
}

// U.S. Standard Atmosphere 1976, Table I, by geopotential altitude: Pa, five digits.
TEST(Earth, ThePressureIsTheStandardAtmospheres) {
  for (const auto& [height, pressure] : {std::pair{-1000.0, 113'930.0},
                                         {0.0, 101'325.0},
                                         {5000.0, 54'020.0},
                                         {11'000.0, 22'632.0},
                                         {15'000.0, 12'045.0},
                                         {20'000.0, 5474.9},
                                         {32'000.0, 868.02},
                                         {47'000.0, 110.91},
                                         {51'000.0, 66.939},
                                         {71'000.0, 3.9564},
                                         {84'852.0, 0.37338}})
    EXPECT_NEAR(standard_pressure(height) / pressure, 1, 5e-5) << height;
  EXPECT_NEAR(geopotential_altitude(80'000), 79'006, 0.5) << "Table I";
  EXPECT_GE(standard_pressure(1e9), 0);
}

TEST(Earth, AltitudeIsTheInverseOfPressure) {
  for (const double altitude : {-500.0, 0.0, 1234.5, 10'999.9, 11'000.0, 15e3, 25e3, 40e3, 50e3, 60e3, 80e3, 90e3})
    EXPECT_NEAR(standard_altitude(standard_pressure(altitude)), altitude, 1e-6) << altitude;
  EXPECT_NEAR(height_of(geopotential_altitude(12'345)), 12'345, 1e-8);
}

TEST(Earth, PositionsBetweenTruthsFollowTheirVelocities) {
  Timeline timeline;
  const auto at = [](double t) {  // a circle of 8 s
    return PositionVelocity{
        true,
        {},
        Vector3(std::cos(t * units::pi / 4), std::sin(t * units::pi / 4), 0) * 1000,
        Vector3(-std::sin(t * units::pi / 4), std::cos(t * units::pi / 4), 0) * (1000 * units::pi / 4)};
  };
  for (int k = 0; k <= 20; ++k) {
    Truth truth;
    truth.time.ns = k * 100'000'000LL;
    const PositionVelocity p = at(0.1 * k);
    truth.has_position = truth.has_velocity = true;
    truth.r_BN_N = p.r_N;
    truth.v_BN_N = p.v_N;
    timeline.push(truth);
  }
  for (double t = 0.05; t < 2; t += 0.013) {
    const PositionVelocity p = timeline.position(TruthTime{} + nanoseconds(t));
    ASSERT_TRUE(p.is_known);
    EXPECT_LT((p.r_N - at(t).r_N).norm(), 1e-4);  // h^4/384 of the fourth derivative: 1e-4
    EXPECT_LT((p.v_N - at(t).v_N).norm(), 1e-2);
  }
  const PositionVelocity after = timeline.position(TruthTime{2'050'000'000});
  EXPECT_LT((after.r_N - at(2).r_N - 0.05 * at(2).v_N).norm(), 1e-9);
  const PositionVelocity held = timeline.position(TruthTime{3'000'000'000});
  EXPECT_EQ(held.time.ns, 2'100'000'000);
  EXPECT_LT((held.r_N - at(2).r_N - 0.1 * at(2).v_N).norm(), 1e-9);
  EXPECT_EQ(timeline.position(TruthTime{-5}).time.ns, 0);
  Truth blind;  // without a position
  blind.time.ns = 2'100'000'000;
  timeline.push(blind);
  EXPECT_FALSE(timeline.position(TruthTime{2'050'000'000}).is_known);
  EXPECT_FALSE(timeline.position(blind.time).is_known);
  EXPECT_TRUE(timeline.position(TruthTime{2'000'000'000}).is_known);
  Truth seeing;
  seeing.time.ns = 2'200'000'000;
  seeing.has_position = seeing.has_velocity = true;
  timeline.push(seeing);
  EXPECT_FALSE(timeline.position(TruthTime{2'150'000'000}).is_known) << "from an unknown one";
  EXPECT_TRUE(timeline.position(seeing.time).is_known);
}

// A sensor turned about the vertical, away from B's origin, and its errors.
TEST(Earth, TheSensorMeasuresFieldAndPressureInItsAxes) {
  ImuModel model;
  model.earth = local(47, 11, 500);
  model.r_SB_B = {0, 0, -100};
  model.dcm_PB = dcm_from_yaw_pitch_roll(units::pi / 2, 0, 0);
  model.barometer.bias = 7;
  Timeline timeline;
  Truth truth;
  truth.has_position = truth.has_velocity = true;
  timeline.push(truth);
  const auto sense = [&](std::uint64_t k) {
    Imu imu(model, 1, 1);
    imu.seek(k);
    return imu.sample(timeline, {}, {});
  };
  const Sample sample = sense(0);
  ASSERT_TRUE(sample.navigation.is_known);
  EXPECT_NEAR(sample.navigation.height, 600, 1e-6);
  EXPECT_NEAR(sample.pressure, standard_pressure(geopotential_altitude(600)) + 7, 1e-6);
  const Earth earth(model.earth);
  const Vector3 field_L = earth.magnetic_field_L(sample.navigation);
  EXPECT_LT((sample.magnetic_field - Vector3(field_L.y(), -field_L.x(), field_L.z())).norm(), 1e-12);
  EXPECT_LT((sample.q_LP * Vector3::UnitX() - Vector3::UnitY()).norm(), 1e-9) << "the sensor looks east";

  // Noise: its standard deviation, within 5 sigma of 4000 samples (each check fails without cause below 1e-6), and
  // its place in the sequence.
  model.magnetometer = TriadErrors::white(1e-8, 100, 1e-3);
  model.barometer.noise = 3;
  constexpr int n = 4000;
  double magnetic = 0, pressure = 0;
  for (int k = 0; k < n; ++k) {
    const Sample noisy = sense(static_cast<std::uint64_t>(k));
    magnetic += (noisy.magnetic_field - sample.magnetic_field).squaredNorm() / 3;
    pressure += (noisy.pressure - sample.pressure) * (noisy.pressure - sample.pressure);
  }
  const double bound = 5 * std::sqrt(2.0 / n);
  EXPECT_NEAR(magnetic / n / 1e-14, 1, bound);
  EXPECT_NEAR(pressure / n / 9, 1, bound);
  model.barometer.bias = -2e5;
  EXPECT_EQ(sense(0).pressure, 0) << "a vacuum at least";
  model.earth.frame = EarthModel::Frame::none;
  EXPECT_TRUE(sense(0).magnetic_field.isZero(0.0));
  EXPECT_EQ(sense(0).pressure, 0);
}

// A random walk: the error of sample k does not depend on whether earlier samples had a position, or were taken.
TEST(Earth, TheMagnetometersWalkGoesOnWherePlacesAreUnknown) {
  ImuModel model;
  model.earth = local(47, 11, 500);
  model.magnetometer.walk_sqrt_cov = 1e-6 * Matrix3::Identity();
  Timeline seeing, blind;
  Truth truth;
  blind.push(truth);
  truth.has_position = truth.has_velocity = true;
  seeing.push(truth);
  constexpr std::uint64_t n = 10;
  Imu always(model, 1, 1), at_last(model, 1, 1), sought(model, 1, 1);
  Vector3 first, last;
  for (std::uint64_t k = 0; k < n; ++k) {
    const TruthTime time = TruthTime{} + k * 1ms;
    last = always.sample(seeing, time, {}).magnetic_field;
    if (k == 0) first = last;
    if (k + 1 == n) break;
    EXPECT_TRUE(at_last.sample(blind, time, {}).magnetic_field.isZero(0.0));
  }
  sought.seek(n - 1);
  const TruthTime time = TruthTime{} + (n - 1) * 1ms;
  EXPECT_EQ(at_last.sample(seeing, time, {}).magnetic_field, last);
  EXPECT_EQ(sought.sample(seeing, time, {}).magnetic_field, last);
  EXPECT_GT((last - first).norm(), 1e-7);
}

// On the equator of the rotating Earth: before the run, and after truth has stopped, the vehicle is at rest on the
// ground, not in inertial space.
TEST(Earth, WhatIsHeldStaysWhereItIsOnTheGround) {
  ImuModel model;
  model.earth = inertial(0.3);
  Timeline timeline;
  const auto on_ground = [](std::int64_t ms) {
    Truth truth;
    truth.time.ns = ms * 1'000'000;
    truth.sequence = static_cast<std::uint32_t>(ms);
    truth.has_position = truth.has_velocity = true;
    const double angle = 0.3 + units::earth_rate * 1e-3 * static_cast<double>(ms);
    truth.r_BN_N = 6'378'137.0 * Vector3(std::cos(angle), std::sin(angle), 0);
    truth.v_BN_N = Vector3(0, 0, units::earth_rate).cross(truth.r_BN_N);
    truth.q_NB = Quaternion(Eigen::AngleAxisd(angle, Vector3::UnitZ()));
    truth.omega_BN_B = {0, 0, units::earth_rate};
    return truth;
  };
  for (int k = 0; k <= 10; ++k) timeline.push(on_ground(60'000 + 10 * k));
  Imu imu(model, 1, 1);
  for (const std::int64_t ms : {0, 60'050, 120'000}) {
    const Sample sample = imu.sample(timeline, TruthTime{ms * 1'000'000}, {});
    ASSERT_TRUE(sample.navigation.is_known) << ms;
    EXPECT_NEAR(sample.navigation.longitude, 0, 1e-9) << ms;
    EXPECT_NEAR(sample.navigation.height, 0, 1e-3) << ms;
    EXPECT_LT(sample.navigation.v_L.norm(), 1e-3) << ms;
    EXPECT_LT((sample.q_LP * Vector3::UnitX() - Vector3(0, 0, -1)).norm(), 1e-6) << "x looks up";
    EXPECT_EQ(sample.navigation.gps_ns, model.earth.start_gps_ns + ms * 1'000'000);
  }
}

// A lever arm to the east, on a body that faces east and turns about the vertical.
TEST(Earth, TheLeverArmHasItsPlaceAndSpeed) {
  ImuModel model;
  model.earth = local(0, 0, 0);
  model.r_SB_B = {100, 0, 0};
  Timeline timeline;
  Truth truth;
  truth.has_position = truth.has_velocity = true;
  truth.q_NB = Quaternion(dcm_from_yaw_pitch_roll(units::pi / 2, 0, 0).transpose());
  truth.omega_BN_B = {0, 0, 0.5};
  timeline.push(truth);
  Imu imu(model, 1, 1);
  const Sample sample = imu.sample(timeline, {}, {});
  EXPECT_NEAR(sample.navigation.longitude * 6'378'137.0, 100, 1e-3);
  EXPECT_LT((sample.navigation.v_L - Vector3(-50, 0, 0)).norm(), 1e-2);
}

}  // namespace
}  // namespace imud
