// A vehicle at rest on the Earth, before the first truth.
#include "core/rest.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "core/attitude.hpp"
#include "core/gps_time.hpp"
#include "core/imu.hpp"
#include "core/units.hpp"
#include "tests/support/allocations.hpp"

namespace imud {
namespace {

using namespace std::chrono_literals;
using Frame = EarthModel::Frame;
constexpr DeltaAngle delta_angles[] = {DeltaAngle::rotation_vector, DeltaAngle::integral};
constexpr DeltaVelocity delta_velocities[] = {DeltaVelocity::integral, DeltaVelocity::memo, DeltaVelocity::end_frame};

EarthModel place(Frame frame, double latitude_deg, double longitude_deg, double height, const Vector3& angles_deg) {
  EarthModel model;
  model.frame = frame;
  model.latitude = latitude_deg * units::degree;
  model.longitude = longitude_deg * units::degree;
  model.height = height;
  model.angle = 1.0;
  model.start_gps_ns = gps_ns_from_unix(1'735'689'600);
  model.rest_yaw_pitch_roll = units::degree * angles_deg;
  return model;
}

// From L to B by Eigen's own rotations, not by the model's.
Matrix3 dcm_BL(const Vector3& angles_deg) {
  using Eigen::AngleAxisd;
  return (AngleAxisd(angles_deg[0] * units::degree, Vector3::UnitZ()) *
          AngleAxisd(angles_deg[1] * units::degree, Vector3::UnitY()) *
          AngleAxisd(angles_deg[2] * units::degree, Vector3::UnitX()))
      .toRotationMatrix()
      .transpose();
}

// WGS 84 (NGA.STND.0036, Table 3.4 and Eq. 4-1): equator, poles. Moritz, Geodetic Reference System 1980 (its gravity
// formula differs from that of WGS 84 by 1e-6 m/s^2): 45 deg, and the decrease with height there.
TEST(Rest, NormalGravityIsThePublishedOne) {
  EXPECT_NEAR(normal_gravity(0, 0), 9.7803253359, 1e-10);
  EXPECT_NEAR(normal_gravity(90 * units::degree, 0), 9.8321849379, 1e-9);
  EXPECT_NEAR(normal_gravity(-90 * units::degree, 0), 9.8321849379, 1e-9);
  EXPECT_NEAR(normal_gravity(45 * units::degree, 0), 9.80619920, 2e-6);
  EXPECT_NEAR(normal_gravity(45 * units::degree, 0) - normal_gravity(45 * units::degree, 1000), 3.085e-3, 1e-6);
  // In the equator's plane, of the zonal harmonics of the normal field (NGA.STND.0036: GM, J2, J4) and the rotation.
  for (const double height : {0.0, 5e3, 10e3}) {
    const double r = 6'378'137.0 + height, ratio2 = std::pow(6'378'137.0 / r, 2);
    const double gravitation =
        3.986004418e14 / (r * r) * (1 + 1.5 * 1.082629821e-3 * ratio2 + 1.875 * 2.37091e-6 * ratio2 * ratio2);
    EXPECT_NEAR(normal_gravity(0, height), gravitation - std::pow(7.292115e-5, 2) * r, 1e-6) << height;
  }
}

TEST(Rest, SensorsMeasureEarthRateAndNormalGravity) {
  ImuModel model;
  model.dcm_PB = dcm_from_yaw_pitch_roll(0.3, -0.2, 2.0);
  int checked = 0;
  for (const Frame frame : {Frame::local, Frame::inertial})
    for (double latitude = -80; latitude <= 80; latitude += 20)
      for (const Vector3& angles : {Vector3(0, 0, 0), Vector3(120, 0, 0), Vector3(-75, 30, -160)}) {
        model.earth = place(frame, latitude, 11, 300, angles);
        Imu imu(model, 1, 1);
        const Sample sample = imu.sample_at_rest(0ns, DeviceTime{7});
        const Vector3 rate_L(7.292115e-5 * std::cos(latitude * units::degree), 0,
                             -7.292115e-5 * std::sin(latitude * units::degree));
        const Vector3 reaction_L(0, 0, -normal_gravity(latitude * units::degree, 300));
        const Matrix3 dcm_PL = model.dcm_PB * dcm_BL(angles);
        EXPECT_LT((sample.rate - dcm_PL * rate_L).norm(), 1e-18) << latitude;
        EXPECT_LT((sample.specific_force - dcm_PL * reaction_L).norm(), 1e-13) << latitude;
        EXPECT_LT((sample.q_LP.toRotationMatrix() - dcm_PL.transpose()).norm(), 1e-13) << latitude;
        ASSERT_TRUE(sample.navigation.is_known);
        EXPECT_NEAR(sample.navigation.latitude, latitude * units::degree, 1e-13);
        EXPECT_NEAR(sample.navigation.longitude, 11 * units::degree, 1e-13);
        EXPECT_NEAR(sample.navigation.height, 300, 1e-8);
        EXPECT_NEAR(sample.pressure, standard_pressure(geopotential_altitude(300)), 1e-6);
        EXPECT_TRUE(sample.navigation.v_L.isZero(0.0));
        EXPECT_EQ(sample.status, status::at_rest);
        EXPECT_EQ(sample.time.ns, 7);
        ++checked;
      }
  EXPECT_EQ(checked, 2 * 9 * 3);
}

// N is level there, z down: 9.80665 m/s^2 up, and no Earth.
TEST(Rest, WithoutAnEarthItIsStandardGravity) {
  for (const DeltaAngle angle : delta_angles)
    for (const DeltaVelocity velocity : delta_velocities) {
      ImuModel model;
      model.delta_angle = angle;
      model.delta_velocity = velocity;
      model.earth = place(Frame::none, 60, 11, 300, Vector3::Zero());
      Imu imu(model, 1, 1);
      for (int k = 0; k < 5; ++k) {
        const Sample sample = imu.sample_at_rest(k * 250ms, {});
        EXPECT_EQ(sample.rate, Vector3::Zero());
        EXPECT_EQ(sample.specific_force, Vector3(0, 0, -9.80665));
        EXPECT_EQ(sample.delta_angle, Vector3::Zero());
        EXPECT_EQ(sample.delta_velocity, Vector3(0, 0, k > 0 ? -0.25 * 9.80665 : 0.0)) << k;
        EXPECT_EQ(sample.q_LP.coeffs(), Quaternion::Identity().coeffs());
        EXPECT_FALSE(sample.navigation.is_known);
        EXPECT_EQ(sample.pressure, 0);
        EXPECT_EQ(sample.status, status::at_rest);
        EXPECT_EQ(sample.counter, static_cast<std::uint64_t>(k));
      }
      model.earth.rest_yaw_pitch_roll = {0, 0, units::pi / 2};
      EXPECT_LT((Imu(model, 1, 1).sample_at_rest(0ns, {}).specific_force - Vector3(0, -9.80665, 0)).norm(), 1e-15)
          << "the right wing down";
    }
}

// The same vehicle as a simulator would send it: standing on an Earth that turns in an inertial frame.
TEST(Rest, AgreesWithATruthThatStandsOnTheTurningEarth) {
  const Vector3 angles(-75, 30, -160);
  for (const DeltaAngle angle : delta_angles)
    for (const DeltaVelocity velocity : delta_velocities) {
      ImuModel model;
      model.earth = place(Frame::inertial, 47, 11, 500, angles);
      model.r_SB_B = {2, -3, 1};
      model.dcm_PB = dcm_from_yaw_pitch_roll(0.3, -0.2, 2.0);
      model.delta_angle = angle;
      model.delta_velocity = velocity;
      Imu at_rest(model, 1, 1), moved(model, 1, 1);
      EarthModel ground = model.earth;
      ground.frame = Frame::local;
      const Vector3 r_E = Earth(ground).navigation({true, {}, Vector3::Zero(), Vector3::Zero()}).r_E;
      const Matrix3 dcm_EB = dcm_EL(ground.latitude, ground.longitude) * dcm_BL(angles).transpose();
      Timeline timeline;
      const int stride = velocity == DeltaVelocity::memo ? 1 : 7;  // memo's increments depend on the truth's steps
      int compared = 0;
      for (int k = 0; k <= 300; ++k) {
        const Quaternion q_NE(Eigen::AngleAxisd(ground.angle + 7.292115e-5 * 0.1 * k, Vector3::UnitZ()));
        Truth truth;
        truth.time = TruthTime{} + k * 100ms;
        truth.q_NB = q_NE * Quaternion(dcm_EB);
        truth.omega_BN_B = dcm_EB.transpose() * Vector3(0, 0, 7.292115e-5);
        truth.has_angular_acceleration = truth.has_specific_force = truth.has_position = truth.has_velocity = true;
        truth.specific_force_B = dcm_BL(angles) * Vector3(0, 0, -normal_gravity(ground.latitude, ground.height));
        truth.r_BN_N = q_NE * r_E;
        truth.v_BN_N = Vector3(0, 0, 7.292115e-5).cross(truth.r_BN_N);
        timeline.push(truth);
        if (k % stride != 0) continue;
        const Sample a = at_rest.sample_at_rest(k * 100ms, {}), b = moved.sample(timeline, truth.time, {});
        EXPECT_LT((a.rate - b.rate).norm(), 1e-15);
        EXPECT_LT((a.specific_force - b.specific_force).norm(), 1e-12);
        EXPECT_LT((a.delta_angle - b.delta_angle).norm(), 1e-14);
        EXPECT_LT((a.delta_velocity - b.delta_velocity).norm(), 1e-12) << static_cast<int>(velocity);
        EXPECT_LT(a.q_LP.angularDistance(b.q_LP), 1e-7);  // angularDistance() of itself is 2e-8
        EXPECT_LT((a.navigation.r_E - b.navigation.r_E).norm(), 1e-6);
        EXPECT_TRUE(a.navigation.v_L.isZero(0.0)) << "at the lever arm's end too";
        EXPECT_LT(b.navigation.v_L.norm(), 1e-6);
        EXPECT_EQ(a.navigation.gps_ns, b.navigation.gps_ns);
        EXPECT_LT((a.magnetic_field - b.magnetic_field).norm(), 1e-15);
        EXPECT_NEAR(a.pressure, b.pressure, 1e-6);
        ++compared;
      }
      EXPECT_EQ(compared, 300 / stride + 1);
    }
}

// An hour at 100 Hz, on the first day and after 29 years.
TEST(Rest, IncrementsAddUpAndNothingDrifts) {
  const Vector3 angles(-75, 30, -160);
  ImuModel model;
  model.earth = place(Frame::inertial, 47, 11, 500, angles);
  for (const Nanoseconds begin : {Nanoseconds{0}, Nanoseconds{29 * 365 * 24h}})
    for (const DeltaAngle angle : delta_angles) {
      model.delta_angle = angle;
      Imu imu(model, 1, 1);
      const Sample first = imu.sample_at_rest(begin, {});
      EXPECT_TRUE(first.delta_angle.isZero(0.0));
      EXPECT_TRUE(first.delta_velocity.isZero(0.0));
      Vector3 turned = Vector3::Zero(), gained = Vector3::Zero();
      double off = 0, moved = 0;
      const std::uint64_t before = allocations();
      for (std::int64_t k = 1; k <= 36'000; ++k) {
        const Sample sample = imu.sample_at_rest(begin + k * 100ms, {});
        turned += sample.delta_angle;
        gained += sample.delta_velocity;
        off = std::max(off, (sample.q_LP.coeffs() - first.q_LP.coeffs()).norm());
        moved = std::max(moved, (sample.navigation.r_E - first.navigation.r_E).norm());
      }
      EXPECT_EQ(allocations(), before);
      EXPECT_EQ(imu.next(), 36'001U);
      EXPECT_LT((turned - 3600 * first.rate).norm(), 1e-9);
      EXPECT_LT((gained - 3600 * first.specific_force).norm(), 1e-6);  // of 35 303 m/s
      EXPECT_LT(off, 1e-12);
      EXPECT_LT(moved, 1e-9);
    }
}

// The vehicle drives off: the truth begins a run, while counter, errors and their random numbers go on.
TEST(Rest, ATruthTakesOver) {
  ImuModel model;
  model.earth = place(Frame::none, 0, 0, 0, Vector3::Zero());
  model.gyro.walk_sqrt_cov = model.accelerometer.walk_sqrt_cov = Matrix3::Identity();  // a random walk
  Imu imu(model, 1, 1), undisturbed(model, 1, 1);
  Timeline timeline;
  Truth truth;
  truth.has_specific_force = true;
  for (const auto ms : {5000, 5100}) {
    truth.time = TruthTime{} + ms * 1ms;
    timeline.push(truth);
  }
  EXPECT_EQ(imu.advanced_to(), Timeline::never);
  for (int k = 0; k < 9; ++k) {
    const Sample sample =
        k < 5 ? imu.sample_at_rest(k * 10ms, {}) : imu.sample(timeline, TruthTime{} + 5s + k * 10ms, {});
    const Sample wanted = undisturbed.sample_at_rest(k * 10ms, {});
    EXPECT_EQ(sample.counter, static_cast<std::uint64_t>(k));
    EXPECT_EQ(sample.status, k < 5 ? status::at_rest : 0U) << k;
    EXPECT_EQ(sample.rate, wanted.rate) << k;
    EXPECT_EQ(sample.delta_angle.isZero(0.0), k == 0 || k == 5) << k;
    EXPECT_NEAR(sample.specific_force.z(), wanted.specific_force.z() + (k < 5 ? 0 : 9.80665), 1e-14) << k;
    EXPECT_EQ(imu.advanced_to(), k < 5 ? Timeline::never : TruthTime{} + 5s + k * 10ms);
  }
  // Power is cut and comes back without a truth.
  EXPECT_TRUE(imu.sample_at_rest(1s, {}).delta_angle.isZero(0.0));
  EXPECT_FALSE(imu.sample_at_rest(2s, {}).delta_angle.isZero(0.0));
  imu.begin_run();
  EXPECT_TRUE(imu.sample_at_rest(0s, {}).delta_angle.isZero(0.0));
}

}  // namespace
}  // namespace imud
