// The timeline after the newest truth, and with truths too rare for the motion.
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "core/attitude.hpp"
#include "core/timeline.hpp"
#include "tests/core/body_motion.hpp"

namespace imud {
namespace {

using namespace std::chrono_literals;

TruthTime truth_at_ms(std::int64_t ms) { return {ms * 1'000'000}; }

Timeline::Limits extrapolate_for(Nanoseconds limit) {
  Timeline::Limits limits;
  limits.extrapolate = limit;
  return limits;
}

// A vehicle that accelerates, under gravitation.
TEST(Extrapolation, VelocityAndPositionFollowTheSpecificForce) {
  const Vector3 force(3, -2, -9), gravitation(0, 0, 9.8), v0(10, -20, 30);
  const auto v = [&](double t) -> Vector3 { return v0 + t * (force + gravitation); };
  const auto r = [&](double t) -> Vector3 { return t * v0 + 0.5 * t * t * (force + gravitation); };
  Timeline timeline;
  for (std::int64_t ms = 0; ms <= 1000; ms += 100) {
    const double t = 1e-3 * static_cast<double>(ms);
    Truth truth;
    truth.time = truth_at_ms(ms);
    truth.has_position = truth.has_velocity = true;
    truth.r_BN_N = r(t);
    truth.v_BN_N = v(t);
    truth.specific_force_B = force;
    timeline.push(truth);
    const PositionVelocity after = timeline.position(truth_at_ms(ms + 80));
    ASSERT_TRUE(after.is_known);
    if (ms == 0) {  // gravitation is not known
      EXPECT_EQ(after.v_N, v0);
      continue;
    }
    EXPECT_LT((after.v_N - v(t + 0.08)).norm(), 1e-9) << ms;
    EXPECT_LT((after.r_N - r(t + 0.08)).norm(), 1e-9) << ms;
  }
  EXPECT_LT((timeline.position(truth_at_ms(5000)).v_N - v(1.1)).norm(), 1e-9);
}

// A simulator that sends each velocity twice.
TEST(Extrapolation, AVelocityThatJumpsIsContinuedAsItIs) {
  Timeline timeline;
  for (std::int64_t k = 0; k <= 10; ++k) {
    Truth truth;
    truth.time = truth_at_ms(k);
    truth.has_position = truth.has_velocity = true;
    truth.v_BN_N = Vector3(0.1 * static_cast<double>(k / 2), 0, 0);
    truth.specific_force_B = Vector3(0, 0, -9.8);
    timeline.push(truth);
  }
  EXPECT_EQ(timeline.position(truth_at_ms(60)).v_N, Vector3(0.5, 0, 0));
}

TEST(Extrapolation, ContinuesWithConstantAccelerations) {
  const IntegratedMotion motion(smooth_motion(), 2.0);
  for (const std::int64_t step_ms : {1, 10, 30}) {
    Timeline timeline;
    for (std::int64_t ms = 0; ms <= 1000; ms += 10) timeline.push(motion.truth(truth_at_ms(ms)));
    const MotionState state = timeline.at(truth_at_ms(1000 + step_ms));
    const double h = 1e-3 * static_cast<double>(step_ms);
    const double t = 1.0 + h;
    EXPECT_EQ(state.basis, MotionState::Basis::extrapolated);
    EXPECT_EQ(state.time, truth_at_ms(1000 + step_ms));
    // The motion's next derivatives are below 1 rad/s^3 and 2 m/s^3.
    EXPECT_LT(angle_between(state.q_NB, motion.q_NB(t)), 1.0 * h * h * h / 6.0);
    EXPECT_LT((state.omega_BN_B - motion.omega_BN_B(t)).norm(), 1.0 * h * h / 2.0);
    EXPECT_LT((state.specific_force_B - motion.specific_force_B(t)).norm(), 2.0 * h);
    EXPECT_LT((state.dv_N - motion.dv_N(t)).norm(), 2.0 * h * h / 2.0);
    EXPECT_EQ(state.omegaDot_BN_B, timeline.at(truth_at_ms(1000)).omegaDot_BN_B);
  }
}

TEST(Extrapolation, BeginsWhereTheNewestTruthIs) {
  const IntegratedMotion motion(smooth_motion(), 2.0);
  Timeline timeline;
  timeline.push(motion.truth(truth_at_ms(0)));
  timeline.push(motion.truth(truth_at_ms(10)));
  const MotionState at = timeline.at(truth_at_ms(10)), after = timeline.at(truth_at_ms(10) + 1ns);
  EXPECT_EQ(at.basis, MotionState::Basis::interpolated);
  EXPECT_EQ(after.basis, MotionState::Basis::extrapolated);
  EXPECT_LT(angle_between(at.q_NB, after.q_NB), 2e-9);
  EXPECT_LT((at.omega_BN_B - after.omega_BN_B).norm(), 2e-9);
  EXPECT_LT((at.dv_N - after.dv_N).norm(), 2e-9);
}

TEST(Extrapolation, ThenHolds) {
  const IntegratedMotion motion(smooth_motion(), 2.0);
  Timeline timeline(extrapolate_for(50ms));
  for (std::int64_t ms = 0; ms <= 1000; ms += 10) timeline.push(motion.truth(truth_at_ms(ms)));
  const MotionState last = timeline.at(truth_at_ms(1050));
  EXPECT_EQ(last.basis, MotionState::Basis::extrapolated);
  for (const Nanoseconds later : {Nanoseconds(1), Nanoseconds(1ms), Nanoseconds(10s), Nanoseconds(24h)}) {
    const MotionState held = timeline.at(truth_at_ms(1050) + later);
    EXPECT_EQ(held.basis, MotionState::Basis::held);
    EXPECT_EQ(held.q_NB.coeffs(), last.q_NB.coeffs());
    EXPECT_EQ(held.omega_BN_B, Vector3::Zero());
    EXPECT_EQ(held.omegaDot_BN_B, Vector3::Zero());
    EXPECT_EQ(held.specific_force_B, last.specific_force_B);
    const Vector3 dv_N = last.dv_N + seconds(later) * (last.q_NB * last.specific_force_B);
    EXPECT_LT((held.dv_N - dv_N).norm(), 1e-15 * (1.0 + dv_N.norm()));
  }
}

TEST(Extrapolation, NoneHoldsAtOnce) {
  Timeline timeline(extrapolate_for(0ns));
  Truth truth;
  truth.omega_BN_B = {1.0, 2.0, 3.0};
  timeline.push(truth);
  EXPECT_EQ(timeline.at({}).omega_BN_B, truth.omega_BN_B);
  EXPECT_EQ(timeline.at({1}).basis, MotionState::Basis::held);
  EXPECT_EQ(timeline.at({1}).omega_BN_B, Vector3::Zero());
}

// A rolling vehicle: many turns within the limit, at a constant rate, for which the solution is known in closed form.
TEST(Extrapolation, FastSpin) {
  Timeline timeline;
  Truth truth;
  truth.omega_BN_B = {0.0, 0.0, 300.0};
  truth.has_specific_force = true;
  truth.specific_force_B = {5.0, 0.0, 2.0};
  timeline.push(truth);
  for (std::int64_t us = 100; us <= 100'000; us += 100) {
    const MotionState state = timeline.at({us * 1000});
    const double t = 1e-6 * static_cast<double>(us), x = 300.0 * t;
    ASSERT_LT(angle_between(state.q_NB, Quaternion(Eigen::AngleAxisd(x, Vector3::UnitZ()))), 1e-13) << us;
    ASSERT_LT((state.omega_BN_B - truth.omega_BN_B).norm(), 1e-12) << us;
    const Vector3 dv_N(5.0 * std::sin(x) / 300.0, 5.0 * (1.0 - std::cos(x)) / 300.0, 2.0 * t);
    ASSERT_LT((state.dv_N - dv_N).norm(), 1e-14) << us;
  }
}

// Also with an angular acceleration across the axis, nothing jumps, however far the vehicle turns.
TEST(Extrapolation, IsContinuousHoweverFarItTurns) {
  Timeline timeline;
  Truth truth;
  truth.omega_BN_B = {2.0, -1.0, 100.0};
  truth.has_angular_acceleration = true;
  truth.omegaDot_BN_B = {50.0, 100.0, -20.0};
  truth.has_specific_force = true;
  truth.specific_force_B = {5.0, -3.0, 2.0};
  timeline.push(truth);
  MotionState before = timeline.at({});
  for (std::int64_t us = 10; us <= 100'000; us += 10) {
    const MotionState state = timeline.at({us * 1000});
    ASSERT_LT(angle_between(before.q_NB, state.q_NB), 1.2e-3) << us;
    ASSERT_LT((state.omega_BN_B - before.omega_BN_B).norm(), 1e-2) << us;
    ASSERT_LT((state.dv_N - before.dv_N).norm(), 7e-5) << us;
    before = state;
  }
}

// Truths far too rare for their motion: the curve is meaningless, but must stay continuous and finite.
TEST(Undersampled, StaysFinite) {
  for (const double rate : {1.0, 3.0, 10.0, 1e3, 1e5})
    for (const Nanoseconds step : {Nanoseconds(1us), Nanoseconds(100ms), Nanoseconds(1s), Nanoseconds(60s)}) {
      Timeline::Limits limits;
      limits.extrapolate = 60s;
      Timeline timeline(limits);
      for (std::int64_t k = 0; k < 8; ++k) {
        Truth truth;
        truth.time = TruthTime{} + k * step;
        truth.q_NB = exp(0.7 * static_cast<double>(k) * Vector3(1.0, -2.0, 0.5));
        truth.omega_BN_B = rate * Vector3(std::cos(double(k)), std::sin(double(k)), -0.5);
        truth.has_angular_acceleration = k % 2 == 0;
        truth.omegaDot_BN_B = 1e3 * truth.omega_BN_B;
        truth.has_specific_force = true;
        truth.specific_force_B = {1e8, -1e8, 1e8};
        ASSERT_TRUE(is_in_range(truth));
        ASSERT_TRUE(timeline.push(truth) == Admission::accepted || k == 0);
      }
      for (int i = 0; i < 1000; ++i) {
        const MotionState state = timeline.at(TruthTime{} + i * step / 100);
        ASSERT_NEAR(state.q_NB.norm(), 1.0, 1e-6) << rate;
        ASSERT_TRUE(state.omega_BN_B.allFinite() && state.omegaDot_BN_B.allFinite()) << rate;
        ASSERT_TRUE(state.specific_force_B.allFinite() && state.dv_N.allFinite()) << rate;
      }
    }
}

}  // namespace
}  // namespace imud
