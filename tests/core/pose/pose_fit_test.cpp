// PoseFit: motions in closed form, given as poses alone.
#include "core/pose/pose_fit.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "core/attitude.hpp"
#include "core/imu.hpp"
#include "tests/core/pose/pose_motion.hpp"

namespace imud {
namespace {

using namespace std::chrono_literals;
using Source = PoseFit::Source;

double angle_of(const Quaternion& q) { return log(q).norm(); }

// Times with a jitter of a third of a step, as float32 seconds have.
TEST(PoseFit, NeedsNoUniformTimes) {
  const PoseMotion& motion = find_pose_motion("aerobatic");
  for (const Nanoseconds step : {1ms, 10ms}) {
    std::vector<Truth> poses;
    std::uint32_t lcg = 1;
    for (Nanoseconds t = 0ms; t < 3s; t += step) {
      lcg = 1'664'525 * lcg + 1'013'904'223;
      const auto jitter = static_cast<std::int64_t>(lcg >> 16) % (step.count() / 3);
      Truth pose = motion.at(TruthTime{} + t + Nanoseconds{jitter});
      pose.has_rate = false;
      pose.has_position = true;
      poses.push_back(pose);
    }
    const FitErrors errors = errors_of(fitted(level, poses), motion);
    EXPECT_LT(errors.rate, step == 1ms ? 5e-12 : 2e-9);
    EXPECT_LT(errors.force, step == 1ms ? 5e-9 : 2e-7);
  }
}

// The acceleration is one derivative of the velocity, but two of the position. With values of float32 resolution the
// velocity therefore gives a much smaller error.
TEST(PoseFit, PrefersTheVelocity) {
  const PoseMotion& motion = find_pose_motion("spiral");
  auto poses = poses_of(motion, 100, 5s, true);
  for (Truth& pose : poses) {
    pose.has_velocity = true;
    pose.v_BN_N = motion.at(pose.time).v_BN_N.unaryExpr(&in_float32);
  }
  const auto derived = fitted(level, poses);
  EXPECT_LT(errors_of(derived, motion).force, 1e-4);
  EXPECT_EQ(derived[100].r_BN_N, poses[100].r_BN_N) << "a given position is kept";
  for (Truth& pose : poses) pose.has_position = false;
  EXPECT_LT(errors_of(fitted(level, poses), motion).force, 1e-4) << "this gravitation needs no position";
  const auto without = fitted({.gravitation = {.kind = GravitationModel::Kind::wgs84}}, poses);
  EXPECT_TRUE(without.size() == poses.size() && !without[100].has_specific_force && without[100].is_rate_derived);
}

// Drives an Imu with the derived truths; the navigator rotates each delta-velocity by the attitude at its end.
void expect_telescoping(const std::vector<Truth>& derived, const GravitationModel& gravitation) {
  ImuModel model;
  model.delta_velocity = DeltaVelocity::end_frame;
  Imu imu(model, 1, 1);
  Timeline timeline;
  Quaternion q;
  Vector3 dv = Vector3::Zero();
  std::int64_t k = 0;
  TruthTime end;
  for (const Truth& truth : derived) {
    ASSERT_NE(timeline.push(truth), Admission::time_back);
    for (; k * 3'700'000 <= truth.time.ns; ++k) {  // not the instants of the truths
      end.ns = k * 3'700'000;
      const Sample sample = imu.sample(timeline, end, DeviceTime{});
      if (k == 0) q = truth.q_NB;
      q = q * exp(sample.delta_angle);
      dv += q * sample.delta_velocity;
    }
    // Each 37th truth of a 100 Hz stream is at the time of a sample.
    if (end.ns != truth.time.ns) continue;
    Vector3 gravitated = Vector3::Zero();
    for (std::size_t i = 1; &derived[i - 1] != &truth; ++i) {
      const Truth &a = derived[i - 1], &b = derived[i];
      const double h = seconds(b.time - a.time);
      // Simpson's rule with the middle of the Hermite curve: another one than the fit's.
      const Vector3 middle = 0.5 * (a.r_BN_N + b.r_BN_N) + h / 8 * (a.v_BN_N - b.v_BN_N);
      gravitated += h / 6 *
                    (gravitation_N(gravitation, a.r_BN_N) + 4 * gravitation_N(gravitation, middle) +
                     gravitation_N(gravitation, b.r_BN_N));
    }
    const Vector3 expected = truth.v_BN_N - derived.front().v_BN_N - gravitated;
    ASSERT_LT(angle_of(q.conjugate() * truth.q_NB), 1e-9);
    ASSERT_LT((dv - expected).norm(), 1e-9) << truth.time.ns;
  }
  EXPECT_GT(k, 1000);
}

TEST(PoseFit, IncrementsSumUpToTheFittedMotion) {
  for (const PoseMotion& motion : pose_motion::table)
    for (const bool as_float32 : {false, true})
      expect_telescoping(fitted(level, poses_of(motion, 100, 10s, as_float32)), level.gravitation);
}

// A circular orbit, drag-free: gravitation is all of the acceleration, and accelerometers measure nothing.
TEST(PoseFit, AnOrbitHasNoSpecificForce) {
  constexpr double radius = 6'778'137.0, gm = 3.986004418e14;
  const double n = std::sqrt(gm / (radius * radius * radius) *
                             (1.0 + 1.5 * 1.08262982131e-3 * std::pow(6'378'137.0 / radius, 2)));  // equatorial, J2
  std::vector<Truth> poses;
  for (std::int64_t i = 0; i <= 1000; ++i) {
    const double t = 0.01 * static_cast<double>(i);
    Truth pose;
    pose.time.ns = i * 10'000'000;
    pose.has_rate = false;
    pose.has_position = true;
    pose.r_BN_N = radius * Vector3(std::cos(n * t), std::sin(n * t), 0);
    pose.q_NB = Eigen::AngleAxisd(n * t, Vector3::UnitZ());
    poses.push_back(pose);
  }
  const GravitationModel j2{.kind = GravitationModel::Kind::j2};
  const auto derived = fitted({.gravitation = j2}, poses);
  for (std::size_t i = 10; i < 990; ++i) {
    EXPECT_LT(derived[i].specific_force_B.norm(), 2e-4) << "a position in double has a resolution of 1e-9 m";
    EXPECT_LT(derived[i].accumulated_dv_B.norm(), 1e-5);
    EXPECT_LT((derived[i].omega_BN_B - Vector3(0, 0, n)).norm(), 1e-12);
  }
  expect_telescoping(derived, j2);
}

TEST(PoseFit, DerivesOnlyWhatIsMissing) {
  const PoseMotion& motion = find_pose_motion("spiral");
  std::vector<Truth> given;
  for (const Truth& pose : poses_of(motion, 100, 2s, false)) {
    Truth truth = motion.at(pose.time);
    truth.has_rate = false;
    truth.has_angular_acceleration = false;
    given.push_back(truth);
  }
  // An attitude that is off by noise of 1e-6 rad, with a large accumulated velocity.
  for (std::size_t i = 0; i < given.size(); ++i) {
    const Vector3 dv_N = Vector3(30'000, 0, 0) + given[i].q_NB * given[i].accumulated_dv_B;
    given[i].q_NB = given[i].q_NB * exp(Vector3(0, 0, i % 2 == 0 ? 1e-6 : -1e-6));
    given[i].accumulated_dv_B = given[i].q_NB.conjugate() * dv_N;
  }
  PoseFit::Options wide = level;
  wide.delay = 100ms;  // corrects the attitudes
  auto derived = fitted(wide, given);
  for (std::size_t i = 0; i < given.size(); ++i) {
    ASSERT_TRUE(derived[i].is_rate_derived && !derived[i].is_force_derived);
    ASSERT_EQ(derived[i].specific_force_B, given[i].specific_force_B);
    ASSERT_LT((derived[i].q_NB * derived[i].accumulated_dv_B - given[i].q_NB * given[i].accumulated_dv_B).norm(),
              1e-10)
        << "a vector in N, which the correction of the attitude does not turn";
  }
  for (Truth& truth : given) {
    truth.has_rate = true;
    truth.has_specific_force = false;
    truth.accumulated_dv = AccumulatedDv::none;
  }
  derived = fitted(level, given);
  for (std::size_t i = 0; i < given.size(); ++i) {
    ASSERT_TRUE(!derived[i].is_rate_derived && derived[i].is_force_derived);
    ASSERT_EQ(derived[i].q_NB.coeffs(), given[i].q_NB.coeffs());
    ASSERT_EQ(derived[i].omega_BN_B, given[i].omega_BN_B);
    ASSERT_LT((derived[i].specific_force_B - given[i].specific_force_B).norm(), 1e-3);
  }
  // Nothing at all: not changed, and not delayed.
  PoseFit fit({.rate = Source::given, .specific_force = Source::given});
  for (const Truth& truth : given) {
    Truth out;
    fit.push(truth);
    ASSERT_TRUE(fit.next(out));
    ASSERT_TRUE(out.time == truth.time && out.omega_BN_B == truth.omega_BN_B && !out.has_specific_force);
    ASSERT_FALSE(fit.next(out));
  }
  // Both, though they are given.
  derived = fitted({.rate = Source::derived, .specific_force = Source::derived, .gravitation = level.gravitation},
                   std::vector<Truth>(given));
  EXPECT_TRUE(derived[50].is_rate_derived && derived[50].is_force_derived);
}

TEST(PoseFit, WaitsForItsDelayAndNoLonger) {
  for (const int rate_hz : {20, 100, 1000}) {
    const PoseMotion& motion = find_pose_motion("coning");
    PoseFit fit(level);
    const Nanoseconds expected = std::max<Nanoseconds>(30ms, 3 * Nanoseconds{1'000'000'000 / rate_hz});
    Truth out;
    bool has_begun = false;
    for (const Truth& pose : poses_of(motion, rate_hz, 2s, false)) {
      fit.push(pose);
      int taken = 0;
      while (fit.next(out)) ++taken;
      if (!has_begun && taken == 0) {
        ASSERT_LT(pose.time - TruthTime{}, 4 * expected) << "13 truths, or twice the delay";
        continue;
      }
      ASSERT_EQ(pose.time - out.time, expected);
      ASSERT_TRUE(!has_begun || taken == 1);
      has_begun = true;
    }
  }
}

TEST(PoseFit, RestartsAtARunAndAtAGap) {
  const PoseMotion& motion = find_pose_motion("aerobatic");
  auto poses = poses_of(motion, 100, 4s, false);
  poses.erase(poses.begin() + 150, poses.begin() + 250);  // a second is missing
  auto derived = fitted(level, poses);
  ASSERT_EQ(derived.size(), poses.size());
  FitErrors errors = errors_of(derived, motion);
  EXPECT_LT(errors.rate, 5e-8);
  EXPECT_LT(errors.force, 1e-6);
  EXPECT_LT((derived[200].q_NB * derived[200].accumulated_dv_B - derived[200].v_BN_N + derived[0].v_BN_N +
             Vector3(0, 0, 9.80665) * seconds(derived[200].time - derived[0].time))
                .norm(),
            1e-9)
      << "the accumulated velocity goes on";

  auto again = poses_of(motion, 100, 1s, false);
  again.front().new_run = true;
  poses.insert(poses.end(), again.begin(), again.end());
  derived = fitted(level, poses);
  ASSERT_EQ(derived.size(), poses.size());
  for (std::size_t i = 0; i < again.size(); ++i) {
    const Truth& truth = derived[poses.size() - again.size() + i];
    ASSERT_EQ(truth.time, again[i].time);
    ASSERT_EQ(truth.new_run, i == 0);
    ASSERT_LT((truth.specific_force_B - motion.at(truth.time).specific_force_B).norm(), 1e-6);
  }
  EXPECT_TRUE(derived[poses.size() - again.size()].accumulated_dv_B.isZero(0));
}

}  // namespace
}  // namespace imud
