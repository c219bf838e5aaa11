// The motion between two truths, before the first and after the last. (Which truths are accepted:
// admission_test.cpp.)
#include "core/timeline.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "core/attitude.hpp"
#include "tests/core/body_motion.hpp"

namespace imud {
namespace {

using namespace std::chrono_literals;

const IntegratedMotion& integrated_motion() {
  static const IntegratedMotion motion(smooth_motion(), 21.0);
  return motion;
}

TruthTime at_ms(std::int64_t ms) { return {ms * 1'000'000}; }

// The smooth trajectory every `step` for `duration`, each truth changed by `change` before it is pushed.
template <class Change>
Timeline timeline_of(Nanoseconds step, Nanoseconds duration, Change change) {
  Timeline timeline;
  std::uint32_t sequence = 0;
  for (TruthTime t = {}; t - TruthTime{} <= duration; t = t + step) {
    Truth truth = integrated_motion().truth(t);
    truth.sequence = sequence++;
    change(truth);
    EXPECT_NE(timeline.push(truth), Admission::duplicate);
  }
  return timeline;
}
Timeline timeline_of(Nanoseconds step, Nanoseconds duration) {
  return timeline_of(step, duration, [](Truth&) {});
}

struct Errors {
  double attitude = 0, rate = 0, dv = 0, force = 0, acceleration = 0;
};

// The largest errors against the motion itself at instants that fall everywhere between truths.
Errors errors_of(const Timeline& timeline, Nanoseconds step, Nanoseconds from, Nanoseconds to) {
  Errors worst;
  for (Nanoseconds t = from; t < to; t += step * 13 / 97 + 1us) {
    const MotionState state = timeline.at(TruthTime{} + t);
    const double s = seconds(t);
    EXPECT_EQ(state.time.ns, t.count());
    EXPECT_EQ(state.basis, MotionState::Basis::interpolated);
    worst.attitude = std::max(worst.attitude, angle_between(state.q_NB, integrated_motion().q_NB(s)));
    worst.rate = std::max(worst.rate, (state.omega_BN_B - integrated_motion().omega_BN_B(s)).norm());
    worst.dv = std::max(worst.dv, (state.dv_N - integrated_motion().dv_N(s)).norm());
    worst.force = std::max(worst.force, (state.specific_force_B - integrated_motion().specific_force_B(s)).norm());
    worst.acceleration = std::max(worst.acceleration, (state.omegaDot_BN_B - smooth_motion().omega_dot(s)).norm());
  }
  return worst;
}

// Measured elsewhere for this trajectory: 1.4e-11 rad, 4.2e-9 rad/s, 2.1e-10 m/s at 10 ms; 1.4e-7, 4.2e-6, 2.1e-6 at
// 100 ms. Linear interpolation of the attitude (slerp) has 5.9e-6 rad and 1.9e-3 rad/s at 10 ms.
TEST(Timeline, HermiteAccuracy) {
  const Errors at_10ms = errors_of(timeline_of(10ms, 9s), 10ms, 0s, 9s);
  EXPECT_LT(at_10ms.attitude, 2e-11);
  EXPECT_LT(at_10ms.rate, 6e-9);
  EXPECT_LT(at_10ms.dv, 3e-10);
  EXPECT_LT(at_10ms.force, 2e-7);
  EXPECT_LT(at_10ms.acceleration, 1e-5);
  const Errors at_100ms = errors_of(timeline_of(100ms, 20s), 100ms, 0s, 20s);
  EXPECT_LT(at_100ms.attitude, 2e-7);
  EXPECT_LT(at_100ms.rate, 6e-6);
  EXPECT_LT(at_100ms.dv, 3e-6);
  EXPECT_LT(at_100ms.force, 2e-4);
  EXPECT_LT(at_100ms.acceleration, 1e-3);
  // Fourth order in the attitude and velocity, third in the rate: not better by luck, either.
  EXPECT_NEAR(std::log10(at_100ms.attitude / at_10ms.attitude), 4.0, 0.2);
  EXPECT_NEAR(std::log10(at_100ms.dv / at_10ms.dv), 4.0, 0.2);
  EXPECT_NEAR(std::log10(at_100ms.rate / at_10ms.rate), 3.0, 0.2);
}

TEST(Timeline, TruthsAreExact) {
  const Timeline timeline = timeline_of(50ms, 20s);
  for (std::int64_t k = 0; k <= 400; ++k) {
    const Truth truth = integrated_motion().truth(at_ms(50 * k));
    const MotionState state = timeline.at(truth.time);
    ASSERT_EQ(state.time, truth.time);
    ASSERT_LT(angle_between(state.q_NB, truth.q_NB), 1e-15);
    ASSERT_EQ(state.omega_BN_B, truth.omega_BN_B);
    ASSERT_EQ(state.omegaDot_BN_B, truth.omegaDot_BN_B);
    ASSERT_EQ(state.specific_force_B, truth.specific_force_B);
    ASSERT_LT((state.dv_N - integrated_motion().dv_N(0.05 * static_cast<double>(k))).norm(), 1e-14);
  }
}

// Attitude and rate, velocity and specific force are one motion, at truths as well as between them, whatever the
// truths' own quality: here 100 ms apart.
TEST(Timeline, RateAndForceAreTheDerivatives) {
  const Timeline timeline = timeline_of(100ms, 5s);
  const auto h = 1ms;
  for (TruthTime t = at_ms(10); t < at_ms(4900); t = t + 7ms) {
    const auto state = [&](int n) { return timeline.at(t + n * h); };
    const MotionState now = state(0);
    const auto turned = [&](int n) { return log(now.q_NB.conjugate() * state(n).q_NB); };
    const Vector3 rate = (8.0 * (turned(1) - turned(-1)) - (turned(2) - turned(-2))) / 0.012;
    const Vector3 acceleration_N =
        (8.0 * (state(1).dv_N - state(-1).dv_N) - (state(2).dv_N - state(-2).dv_N)) / 0.012;
    // Where a truth lies within the stencil, the third derivative jumps, which affects the stencil.
    ASSERT_LT((rate - now.omega_BN_B).norm(), 3e-7) << t.ns;
    ASSERT_LT((acceleration_N - now.q_NB * now.specific_force_B).norm(), 3e-7) << t.ns;
  }
}

TEST(Timeline, StateIsContinuousAtTruths) {
  const Timeline timeline = timeline_of(100ms, 5s);
  for (std::int64_t k = 1; k < 50; ++k) {
    const TruthTime t = at_ms(100 * k);
    const MotionState here = timeline.at(t);
    for (const MotionState& beside : {timeline.at(t - 1ns), timeline.at(t + 1ns)}) {
      ASSERT_LT(angle_between(here.q_NB, beside.q_NB), 2e-9);
      ASSERT_LT((here.omega_BN_B - beside.omega_BN_B).norm(), 2e-9);
      ASSERT_LT((here.omegaDot_BN_B - beside.omegaDot_BN_B).norm(), 2e-8);
      ASSERT_LT((here.dv_N - beside.dv_N).norm(), 2e-9);
      ASSERT_LT((here.specific_force_B - beside.specific_force_B).norm(), 1e-8);
    }
  }
}

TEST(Timeline, SignOfTheQuaternionAndMrpShadowDoNotMatter) {
  const Timeline expected = timeline_of(50ms, 5s);
  const Timeline shadowed = timeline_of(50ms, 5s, [](Truth& truth) {
    // As a simulator that changes to the shadow set in the middle, and back again.
    const bool shadow = truth.sequence >= 30 && truth.sequence < 70;
    const Vector3 sigma = mrp_from_quaternion(truth.q_NB);
    truth.q_NB = quaternion_from_mrp(shadow ? mrp_shadow(sigma) : sigma);
    if (truth.sequence % 3 == 0) truth.q_NB.coeffs() *= -1.0;
  });
  for (TruthTime t = {}; t < at_ms(5000); t = t + 3ms) {
    ASSERT_LT(angle_between(expected.at(t).q_NB, shadowed.at(t).q_NB), 2e-15) << t.ns;
    ASSERT_LT((expected.at(t).omega_BN_B - shadowed.at(t).omega_BN_B).norm(), 1e-13) << t.ns;
    ASSERT_LT((expected.at(t).dv_N - shadowed.at(t).dv_N).norm(), 1e-13) << t.ns;
  }
}

// As from a simulator that integrates the quaternion, or sends few digits.
TEST(Timeline, QuaternionsAreMadeUnit) {
  const Timeline expected = timeline_of(50ms, 1s);
  const Timeline timeline = timeline_of(50ms, 1s, [](Truth& truth) {
    truth.q_NB.coeffs() *= truth.sequence % 2 == 0 ? 1.0 + 9e-7 : 1.0 - 9e-7;
    ASSERT_TRUE(is_in_range(truth));
  });
  for (TruthTime t = {}; t < at_ms(1000); t = t + 3ms) {
    ASSERT_NEAR(timeline.at(t).q_NB.norm(), 1.0, 1e-15);
    ASSERT_LT(angle_between(expected.at(t).q_NB, timeline.at(t).q_NB), 2e-15) << t.ns;
    ASSERT_LT((expected.at(t).dv_N - timeline.at(t).dv_N).norm(), 1e-14) << t.ns;
  }
}

TEST(Timeline, AngularAccelerationOfTheRatesWhereNoneIsGiven) {
  const auto without = [](Truth& truth) {
    truth.has_angular_acceleration = false;
    truth.omegaDot_BN_B = {1e3, 1e3, 1e3};  // to be ignored
  };
  EXPECT_LT(errors_of(timeline_of(10ms, 9s, without), 10ms, 10ms, 9s).acceleration, 1e-3);  // the first interval's
  EXPECT_LT(errors_of(timeline_of(100ms, 20s, without), 100ms, 100ms, 20s).acceleration, 3e-2);
  // At truths as well, where a lever arm turns it into specific force.
  const Timeline timeline = timeline_of(10ms, 9s, without);
  for (std::int64_t k = 2; k < 900; ++k)
    ASSERT_LT(
        (timeline.at(at_ms(10 * k)).omegaDot_BN_B - smooth_motion().omega_dot(0.01 * static_cast<double>(k))).norm(),
        5e-5)
        << k;
}

// The rate t^2 about z: its differences are the acceleration in the middle of each interval, which is linear in t.
TEST(Timeline, AngularAccelerationOfUnequalSteps) {
  Timeline timeline;
  for (const std::int64_t ms : {0, 10, 40, 50, 51, 100, 102}) {
    const double t = 1e-3 * static_cast<double>(ms);
    Truth truth;
    truth.time = at_ms(ms);
    truth.q_NB = exp(Vector3(0, 0, t * t * t / 3.0));
    truth.omega_BN_B = {0, 0, t * t};
    timeline.push(truth);
  }
  for (std::int64_t ms = 10; ms <= 102; ++ms)
    EXPECT_NEAR(timeline.at(at_ms(ms)).omegaDot_BN_B.z(), 2e-3 * static_cast<double>(ms), ms > 10 ? 1e-12 : 0.011)
        << ms;
}

TEST(Timeline, AttitudeSteppedByTheOldOrNewRateDoesNotDisturbTheAcceleration) {
  // Semi-implicit Euler at 100 Hz, the rate growing by 1 rad/s^2: attitude and rate disagree by 5e-3 rad/s.
  for (const double of_new_rate : {0.0, 1.0}) {
    Timeline timeline;
    double angle = 0.0;
    for (std::uint32_t k = 0; k <= 100; ++k) {
      Truth truth;
      truth.time = at_ms(10 * std::int64_t{k});
      truth.sequence = k;
      if (k > 0) angle += 0.01 * (0.01 * (k - 1.0 + of_new_rate));
      truth.q_NB = exp(Vector3(0, 0, angle));
      truth.omega_BN_B = {0, 0, 0.01 * k};
      timeline.push(truth);
    }
    for (std::int64_t ms = 1; ms <= 1050; ++ms)
      ASSERT_NEAR(timeline.at(at_ms(ms)).omegaDot_BN_B.z(), 1.0, 1e-9) << ms;
    EXPECT_NEAR(timeline.at(at_ms(1050)).omega_BN_B.z(), 1.05, 1e-9);  // extrapolated
  }
}

TEST(Timeline, IntegratesTheForceWhereNoVelocityIsGiven) {
  const auto without = [](Truth& truth) { truth.accumulated_dv = AccumulatedDv::none; };
  const Errors at_10ms = errors_of(timeline_of(10ms, 9s, without), 10ms, 0s, 9s);
  EXPECT_LT(at_10ms.dv, 1e-4);  // as the trapezoid of the force: h^2/12 of the change of its slope
  const Errors at_100ms = errors_of(timeline_of(100ms, 20s, without), 100ms, 0s, 20s);
  EXPECT_LT(at_100ms.dv, 1e-2);
  EXPECT_LT(at_100ms.force, 1e-2);
  // A force that is constant in body axes is integrated along the turning attitude as exactly as the attitude is
  // known.
  const auto constant = [](Truth& truth) {
    truth.accumulated_dv = AccumulatedDv::none;
    truth.specific_force_B = {1.0, 2.0, -3.0};
  };
  const Timeline turning = timeline_of(100ms, 5s, constant);
  Vector3 exact = Vector3::Zero();
  for (int i = 0; i < 5000; ++i)
    exact += 1e-3 * (integrated_motion().q_NB(1e-3 * (i + 0.5)) * Vector3(1.0, 2.0, -3.0));
  EXPECT_LT((turning.at(at_ms(5000)).dv_N - exact).norm(), 2e-6);
}

TEST(Timeline, LinearVelocityWhereNoForceIsGiven) {
  const auto without = [](Truth& truth) { truth.has_specific_force = false; };
  const Timeline timeline = timeline_of(100ms, 20s, without);
  const Errors errors = errors_of(timeline, 100ms, 0s, 20s);
  EXPECT_LT(errors.dv, 3e-3);  // 2.2e-3 was measured
  EXPECT_GT(errors.dv, 3e-4);
  for (std::int64_t k = 1; k < 200; ++k) {
    const Vector3 slope_N = (integrated_motion().dv_N(0.1 * static_cast<double>(k)) -
                             integrated_motion().dv_N(0.1 * static_cast<double>(k - 1))) /
                            0.1;
    for (const std::int64_t ms : {100 * k, 100 * k - 30}) {
      const MotionState state = timeline.at(at_ms(ms));
      ASSERT_LT((state.q_NB * state.specific_force_B - slope_N).norm(), 1e-12);
    }
  }
}

TEST(Timeline, ZeroWhereNeitherIsGiven) {
  const Timeline timeline = timeline_of(100ms, 5s, [](Truth& truth) {
    truth.has_specific_force = false;
    truth.accumulated_dv = AccumulatedDv::none;
  });
  for (TruthTime t = {}; t < at_ms(5000); t = t + 37ms) {
    ASSERT_EQ(timeline.at(t).dv_N, Vector3::Zero());
    ASSERT_EQ(timeline.at(t).specific_force_B, Vector3::Zero());
    ASSERT_LT((timeline.at(t).omega_BN_B - integrated_motion().omega_BN_B(seconds(t - TruthTime{}))).norm(), 6e-6);
  }
}

// The sum of increments, each in the body axes at the end of its own truth step, holds the same inertial velocity.
TEST(Timeline, BodySumIsTheSameVelocity) {
  Vector3 sum = Vector3::Zero();
  Vector3 before_N = Vector3::Zero();
  const Timeline timeline = timeline_of(50ms, 20s, [&](Truth& truth) {
    const Vector3 dv_N = truth.q_NB * truth.accumulated_dv_B;
    sum += truth.q_NB.conjugate() * (dv_N - before_N);
    before_N = dv_N;
    truth.accumulated_dv = AccumulatedDv::body_sum;
    truth.accumulated_dv_B = sum;
  });
  EXPECT_GT((sum - integrated_motion().q_NB(20.0).conjugate() * integrated_motion().dv_N(20.0)).norm(),
            0.5);  // another vector altogether
  const Errors errors = errors_of(timeline, 50ms, 0s, 20s);
  EXPECT_LT(errors.dv, 3e-7);
}

TEST(Timeline, VelocityCountsFromTheFirstTruthOfTheRun) {
  const Vector3 offset_N(4000.0, -300.0, 20.0);
  const Timeline timeline =
      timeline_of(50ms, 5s, [&](Truth& truth) { truth.accumulated_dv_B += truth.q_NB.conjugate() * offset_N; });
  EXPECT_LT(errors_of(timeline, 50ms, 0s, 5s).dv, 3e-7);
}

TEST(Timeline, KindMayChangeInMidStream) {
  Vector3 sum(7.0, 7.0, 7.0), before_N = Vector3::Zero();
  const Timeline timeline = timeline_of(10ms, 9s, [&](Truth& truth) {
    const Vector3 dv_N = truth.q_NB * truth.accumulated_dv_B;
    sum += truth.q_NB.conjugate() * (dv_N - before_N);
    before_N = dv_N;
    switch (truth.sequence / 100 % 4) {
      case 0:  // inertial
        break;
      case 1:
        truth.accumulated_dv = AccumulatedDv::none;
        break;
      case 2:  // inertial again, from another origin
        truth.accumulated_dv_B += truth.q_NB.conjugate() * Vector3(100.0, 200.0, 300.0);
        break;
      default:
        truth.accumulated_dv = AccumulatedDv::body_sum;
        truth.accumulated_dv_B = sum;
    }
  });
  // Only the stretches without velocity, and each first step of another kind, are integrated from the force.
  EXPECT_LT(errors_of(timeline, 10ms, 0s, 9s).dv, 1e-4);
}

TEST(Timeline, OwnForceOfATruthCountsAtItsInstant) {
  const Timeline timeline =
      timeline_of(50ms, 2s, [](Truth& truth) { truth.has_specific_force = truth.sequence % 2 == 1; });
  for (std::int64_t k = 1; k < 40; k += 2)
    EXPECT_EQ(timeline.at(at_ms(50 * k)).specific_force_B, integrated_motion().truth(at_ms(50 * k)).specific_force_B)
        << k;
}

TEST(Timeline, BeforeTheRunIsAsIfItHadWaitedThere) {
  const Timeline timeline = timeline_of(10ms, 1s);
  const MotionState state = timeline.at(TruthTime{-5'000'000'000});
  const MotionState first = timeline.at({});
  EXPECT_EQ(state.time.ns, -5'000'000'000);
  EXPECT_EQ(state.basis, MotionState::Basis::held);
  EXPECT_EQ(state.q_NB.coeffs(), first.q_NB.coeffs());
  EXPECT_EQ(state.omega_BN_B, Vector3::Zero());
  EXPECT_EQ(state.specific_force_B, first.specific_force_B);
  EXPECT_LT((state.dv_N + 5.0 * (first.q_NB * first.specific_force_B)).norm(), 1e-12);
  EXPECT_EQ(timeline.next_truth(TruthTime{-5'000'000'000}).ns, 0);
}

TEST(Timeline, AnInsertedTruthIsAsIfItHadComeInOrder) {
  const auto kinds = {AccumulatedDv::inertial, AccumulatedDv::body_sum, AccumulatedDv::none};
  for (const AccumulatedDv kind : kinds)
    for (const bool has_force : {true, false}) {
      const auto change = [&](Truth& truth) {
        truth.accumulated_dv = kind;
        truth.has_specific_force = has_force;
        truth.has_angular_acceleration = false;
      };
      const Timeline in_order = timeline_of(10ms, 200ms, change);
      Timeline overtaken;
      for (const std::int64_t k : {0, 1, 2, 4, 5, 8, 9, 7, 3, 10, 6, 12, 11, 13, 14, 15, 16, 17, 18, 19, 20}) {
        Truth truth = integrated_motion().truth(at_ms(10 * k));
        truth.sequence = static_cast<std::uint32_t>(k);
        change(truth);
        overtaken.push(truth, {});
      }
      for (Nanoseconds t{0}; t <= 230ms; t += 1ms + 1us) {
        const MotionState a = in_order.at(TruthTime{} + t), b = overtaken.at(TruthTime{} + t);
        ASSERT_EQ(a.q_NB.coeffs(), b.q_NB.coeffs()) << t.count();
        ASSERT_EQ(a.omega_BN_B, b.omega_BN_B) << t.count();
        ASSERT_EQ(a.omegaDot_BN_B, b.omegaDot_BN_B) << t.count();
        ASSERT_EQ(a.specific_force_B, b.specific_force_B) << t.count();
        ASSERT_EQ(a.dv_N, b.dv_N) << t.count();
        ASSERT_EQ(a.basis, b.basis) << t.count();
      }
    }
}

TEST(Timeline, KeepsTheNewestThousand) {
  const Timeline timeline = timeline_of(1ms, 20s);
  EXPECT_EQ(timeline.run_start().ns, 0);
  EXPECT_EQ(timeline.newest(), at_ms(20'000));
  const auto oldest = at_ms(20'000 - (static_cast<std::int64_t>(Timeline::capacity) - 1));
  EXPECT_EQ(timeline.at({}).time, oldest);
  EXPECT_EQ(timeline.at(oldest - 1ms).time, oldest);
  const Errors errors = errors_of(timeline, 1ms, oldest - TruthTime{}, 20s);
  EXPECT_LT(errors.attitude, 2e-14);
  EXPECT_LT(errors.dv, 1e-13);
  for (TruthTime t = oldest; t < at_ms(20'000); t = t + 1ms) ASSERT_EQ(timeline.at(t).time, t);
}

TEST(Timeline, NextTruth) {
  Timeline timeline;
  constexpr TruthTime never{std::numeric_limits<std::int64_t>::max()};
  EXPECT_EQ(timeline.next_truth({}), never);
  for (std::int64_t k = 0; k < 100; ++k) {
    timeline.push(integrated_motion().truth(at_ms(10 * k)));
    EXPECT_EQ(timeline.next_truth(at_ms(10 * k)), never);
    EXPECT_EQ(timeline.next_truth(at_ms(10 * k + 3)), never);
    EXPECT_EQ(timeline.next_truth(at_ms(-7)), at_ms(0));
    for (std::int64_t j = 0; j < k; ++j) {
      ASSERT_EQ(timeline.next_truth(at_ms(10 * j)), at_ms(10 * (j + 1)));
      ASSERT_EQ(timeline.next_truth(at_ms(10 * j + 1)), at_ms(10 * (j + 1)));
      ASSERT_EQ(timeline.next_truth(at_ms(10 * j) - 1ns), at_ms(10 * j));
    }
  }
}

}  // namespace
}  // namespace imud
