// The quantities of each motion agree with one another: checked by differences, and by the sums of an Imu.
#include "tools/truth/motion.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "core/attitude.hpp"
#include "core/imu.hpp"
#include "core/timeline.hpp"
#include "tests/core/body_motion.hpp"
#include "tests/core/drive.hpp"

namespace imud {
namespace {

using namespace std::chrono_literals;

struct Case {
  std::string name;
  MotionParameters parameters;
};

class EveryMotion : public ::testing::TestWithParam<Case> {
 protected:
  Truth at(double t) const {
    return find_motion(GetParam().name)
        ->at({static_cast<std::int64_t>(std::llround(t * 1e9))}, GetParam().parameters);
  }
  // Central difference of fourth order, with a step that is a whole number of ns.
  template <class Quantity>
  static Vector3 derivative(Quantity quantity, double t, double h) {
    return (8.0 * (quantity(t + h) - quantity(t - h)) - (quantity(t + 2 * h) - quantity(t - 2 * h))) / (12.0 * h);
  }
  const std::vector<double> times = {0.0, 0.1, 0.777, 2.0, 5.5, 20.0, 100.0};
  double step() const { return GetParam().name == "coning" ? 1e-4 : 1e-3; }
};

TEST_P(EveryMotion, GivesEveryQuantityOfATruth) {
  const Truth truth = at(1.25);
  EXPECT_EQ(truth.time.ns, 1'250'000'000);
  EXPECT_TRUE(truth.has_angular_acceleration);
  EXPECT_TRUE(truth.has_specific_force);
  EXPECT_EQ(truth.accumulated_dv, AccumulatedDv::inertial);
  EXPECT_TRUE(is_finite(truth) && is_in_range(truth));
  EXPECT_NEAR(truth.q_NB.norm(), 1.0, 1e-15);
  EXPECT_LT(at(0.0).accumulated_dv_B.norm(), 1e-15);
  EXPECT_LT(at(0.0).r_BN_N.norm(), 1e-15);
}

TEST_P(EveryMotion, VelocityIsTheDerivativeOfPosition) {
  for (const double t : times)
    EXPECT_LT((derivative([&](double s) { return at(s).r_BN_N; }, t, step()) - at(t).v_BN_N).norm(),
              1e-9 * (1.0 + at(t).v_BN_N.norm()) + 1e-12 * at(t).r_BN_N.norm())
        << t;
}

// With gravity along N's z added to the specific force.
TEST_P(EveryMotion, AccelerationIsTheForceAndGravity) {
  const Vector3 gravity_N(0.0, 0.0, GetParam().parameters.gravity_m_per_s2);
  for (const double t : times)
    EXPECT_LT((derivative([&](double s) { return at(s).v_BN_N; }, t, step()) -
               (at(t).q_NB * at(t).specific_force_B + gravity_N))
                  .norm(),
              1e-8 + 1e-11 * at(t).v_BN_N.norm())
        << t;
}

TEST_P(EveryMotion, AccumulatedVelocityIsTheIntegralOfTheForce) {
  for (const double t : times)
    EXPECT_LT((derivative([&](double s) { return Vector3(at(s).q_NB * at(s).accumulated_dv_B); }, t, step()) -
               at(t).q_NB * at(t).specific_force_B)
                  .norm(),
              1e-8 + 1e-11 * at(t).accumulated_dv_B.norm())
        << t;
}

TEST_P(EveryMotion, RateIsTheDerivativeOfAttitude) {
  for (const double t : times) {
    const Truth now = at(t);
    const auto turned = [&](double s) { return log(now.q_NB.conjugate() * at(s).q_NB); };
    EXPECT_LT((derivative(turned, t, step()) - now.omega_BN_B).norm(), 1e-9) << t;
    EXPECT_LT((derivative([&](double s) { return at(s).omega_BN_B; }, t, step()) - now.omegaDot_BN_B).norm(), 2e-7)
        << t;
  }
}

// The whole chain: truth at 100 Hz, sensor at 400 Hz.
TEST_P(EveryMotion, SumsOfAnImuComeToTheMotion) {
  ImuModel model;
  model.delta_velocity = DeltaVelocity::end_frame;
  Quaternion q_NB = at(0.0).q_NB;
  Vector3 dv_N = Vector3::Zero();
  for (const Sample& sample : drive(
           model, [&](TruthTime t) { return at(seconds(t - TruthTime{})); }, instants(100.0, 5s),
           instants(400.0, 5s))) {
    q_NB = q_NB * exp(sample.delta_angle);
    dv_N += q_NB * sample.delta_velocity;
  }
  EXPECT_LT(angle_between(q_NB, at(5.0).q_NB), 1e-12);
  EXPECT_LT((dv_N - at(5.0).q_NB * at(5.0).accumulated_dv_B).norm(), 1e-11);
}

TEST_P(EveryMotion, IsSmoothWhereItsFormulaChanges) {
  // The integrals of a turn are a power series below 1 rad.
  const double rate = GetParam().parameters.rate_rad_per_s;
  const double t = rate != 0.0 ? std::abs(1.0 / rate) : 1.0;
  const Truth before = at(t - 2e-9), after = at(t + 2e-9);
  EXPECT_LT((after.r_BN_N - before.r_BN_N - 4e-9 * before.v_BN_N).norm(), 1e-13 * (1.0 + before.r_BN_N.norm()));
  EXPECT_LT((after.v_BN_N - before.v_BN_N).norm(), 1e-7 * (1.0 + before.v_BN_N.norm()));
}

MotionParameters with(double rate, double acceleration, double jerk, double gravity) {
  MotionParameters parameters;
  parameters.rate_rad_per_s = rate;
  parameters.acceleration_m_per_s2 = acceleration;
  parameters.jerk_m_per_s3 = jerk;
  parameters.gravity_m_per_s2 = gravity;
  return parameters;
}

INSTANTIATE_TEST_SUITE_P(
    Motions, EveryMotion,
    ::testing::Values(Case{"rest", {}}, Case{"turntable", {}}, Case{"turntable", with(-3.0, 0, 0, 9.8)},
                      Case{"spiral", {}}, Case{"spiral", with(0.0, 1.5, 0, 9.8)},
                      Case{"spiral", with(1e-6, 1.5, 0, 9.8)}, Case{"spiral", with(-0.7, 3.0, 0, 0.0)},
                      Case{"boost", {}}, Case{"boost", with(0.0, 20.0, 1.0, 9.8)},
                      Case{"boost", with(1e-7, 20.0, 1.0, 9.8)}, Case{"boost", with(-0.05, 20.0, 1.0, 0.0)}));

// A slow cone, as differences cannot resolve the rates of the default one.
MotionParameters slow_cone() {
  MotionParameters parameters;
  parameters.half_angle_rad = 0.4;
  parameters.frequency_hz = 0.5;
  return parameters;
}
INSTANTIATE_TEST_SUITE_P(Coning, EveryMotion, ::testing::Values(Case{"coning", slow_cone()}));

TEST(Motions, AreFoundByName) {
  std::vector<std::string> names;
  for (const Motion& motion : motions()) {
    names.emplace_back(motion.name);
    EXPECT_EQ(find_motion(motion.name), &motion);
    EXPECT_FALSE(motion.summary.empty());
  }
  EXPECT_EQ(names, (std::vector<std::string>{"rest", "turntable", "coning", "spiral", "boost"}));
  EXPECT_EQ(find_motion("loop"), nullptr);
  EXPECT_EQ(find_motion(""), nullptr);
}

TEST(Motions, Rest) {
  const Truth truth = find_motion("rest")->at({10'000'000'000}, {});
  EXPECT_EQ(truth.specific_force_B, Vector3(0.0, 0.0, -9.80665));
  EXPECT_NEAR(truth.accumulated_dv_B.z(), -98.0665, 1e-12);
  EXPECT_EQ(truth.omega_BN_B, Vector3::Zero());
  EXPECT_EQ(truth.q_NB.coeffs(), Quaternion::Identity().coeffs());
}

TEST(Motions, Turntable) {
  const Truth truth = find_motion("turntable")->at({3'000'000'000}, {});
  EXPECT_EQ(truth.omega_BN_B, Vector3(0.0, 0.0, 0.5));
  EXPECT_EQ(truth.specific_force_B, Vector3(0.0, 0.0, -9.80665));
  EXPECT_LT(angle_between(truth.q_NB, Quaternion(Eigen::AngleAxisd(1.5, Vector3::UnitZ()))), 1e-15);
}

// q = [cos a/2, sin a/2 cos Wt, sin a/2 sin Wt, 0], w = [-W sin a sin Wt, W sin a cos Wt, -2 W sin^2 a/2].
TEST(Motions, Coning) {
  const double a = 0.02, W = 2.0 * 3.14159265358979324 * 10.0, t = 0.1234;
  const Truth truth = find_motion("coning")->at({123'400'000}, {});
  const Quaternion q(std::cos(a / 2), std::sin(a / 2) * std::cos(W * t), std::sin(a / 2) * std::sin(W * t), 0.0);
  EXPECT_LT(angle_between(truth.q_NB, q), 1e-15);
  EXPECT_LT((truth.omega_BN_B - Vector3(-W * std::sin(a) * std::sin(W * t), W * std::sin(a) * std::cos(W * t),
                                        -2.0 * W * std::sin(a / 2) * std::sin(a / 2)))
                .norm(),
            1e-13);
  EXPECT_LT((truth.q_NB * truth.specific_force_B - Vector3(0, 0, -9.80665)).norm(), 1e-14);
}

// A whole number of turns later it is where it was, to the last digit.
TEST(Motions, ConingKeepsItsPhase) {
  MotionParameters parameters;
  parameters.half_angle_rad = 0.5;
  const Truth start = find_motion("coning")->at({}, parameters);
  const Truth days_later = find_motion("coning")->at({100 * 86'400'000'000'000}, parameters);
  EXPECT_LT(angle_between(days_later.q_NB, start.q_NB), 1e-15);
  EXPECT_EQ(days_later.omega_BN_B, start.omega_BN_B);
}

TEST(Motions, Spiral) {
  const Truth truth = find_motion("spiral")->at({4'000'000'000}, {});  // 2 m/s^2, 0.5 rad/s: 8 m/s at 2 rad
  EXPECT_LT((truth.v_BN_N - 8.0 * Vector3(std::cos(2.0), std::sin(2.0), 0.0)).norm(), 1e-14);
  EXPECT_LT((truth.q_NB.conjugate() * truth.v_BN_N - Vector3(8.0, 0.0, 0.0)).norm(), 1e-14);
  EXPECT_LT((truth.specific_force_B - Vector3(2.0, 4.0, -9.80665)).norm(), 1e-14);
}

TEST(Motions, BoostWithoutPitchIsAPolynomial) {
  MotionParameters parameters;
  parameters.rate_rad_per_s = 0.0;
  const Truth truth = find_motion("boost")->at({10'000'000'000}, parameters);  // 2 m/s^2, 0.5 m/s^3
  EXPECT_NEAR(truth.v_BN_N.x(), 20.0 + 25.0, 1e-12);
  EXPECT_NEAR(truth.r_BN_N.x(), 100.0 + 500.0 / 6.0, 1e-12);
  EXPECT_NEAR(truth.v_BN_N.z(), 98.0665, 1e-12);
  EXPECT_NEAR(truth.r_BN_N.z(), 490.3325, 1e-12);
  EXPECT_NEAR(truth.specific_force_B.x(), 7.0, 1e-14);
}

// Where sines and cosines cancel: up = j t^3 (x/12 - x^3/180 + x^5/6720 - ...) for x = w t.
TEST(Motions, BoostWithLittlePitchKeepsItsDigits) {
  MotionParameters parameters;
  parameters.acceleration_m_per_s2 = 0.0;
  parameters.jerk_m_per_s3 = 100.0;
  parameters.gravity_m_per_s2 = 0.0;
  for (const double x : {1e-9, 1e-4, 1e-3, 1e-2}) {
    parameters.rate_rad_per_s = x;
    const Truth truth = find_motion("boost")->at({1'000'000'000}, parameters);
    EXPECT_NEAR(-truth.r_BN_N.z() / (100.0 * x * (1.0 / 12.0 - x * x / 180.0 + x * x * x * x / 6720.0)), 1.0, 1e-13)
        << x;
  }
}

// Nose up is toward N's -z.
TEST(Motions, BoostPitchesUp) {
  const Truth truth = find_motion("boost")->at({1'000'000'000}, {});
  EXPECT_LT((truth.q_NB * Vector3::UnitX()).z(), 0.0);
  EXPECT_LT((truth.q_NB * truth.accumulated_dv_B).z(), 0.0);
}

}  // namespace
}  // namespace imud
