// PoseFit with noise: the window that it chooses, outliers, gaps.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "core/attitude.hpp"
#include "core/pose/pose_fit.hpp"
#include "core/timeline.hpp"
#include "tests/core/pose/pose_motion.hpp"

namespace imud {
namespace {

using namespace std::chrono_literals;

constexpr PoseFit::Options chosen{.widest = 8,
                                  .gravitation = {.kind = GravitationModel::Kind::constant, .constant = 9.80665}};

struct NoiseOfPoses {
  double angle = 0, distance = 0;  // rad, m; rms of a component
  double jitter_s = 0;             // of the times, uniform to either side
  double lost = 0;                 // share of the poses
};

// Smooth motion to 0.8 Hz, of up to 2 rad/s and 2 m/s.
Truth hand_held(TruthTime time) {
  using pose_motion::Swing;
  constexpr double tau = 6.283185307179586;
  constexpr Swing angle[] = {{0.5, tau * 0.2, 0, 0}, {0.2, tau * 0.8, 1, 0}, {0.3, tau * 0.5, 0, 0}};
  constexpr Swing r[] = {{1, tau * 0.3, 0, 0}, {0.7, tau * 0.4, 0.5, 0}, {0.3, tau * 0.7, 0, 0}};
  const double t = seconds(time - TruthTime{});
  const Vector3 phi(angle[0].value(t), angle[1].value(t), angle[2].value(t));
  const Vector3 phi_dot(angle[0].first(t), angle[1].first(t), angle[2].first(t));
  Truth truth;
  truth.time = time;
  truth.q_NB = exp(phi);
  truth.omega_BN_B = right_jacobian(phi, phi_dot);
  truth.r_BN_N = {r[0].value(t), r[1].value(t), r[2].value(t)};
  truth.v_BN_N = {r[0].first(t), r[1].first(t), r[2].first(t)};
  truth.specific_force_B = truth.q_NB.conjugate() * Vector3(r[0].second(t), r[1].second(t), r[2].second(t) - 9.80665);
  return truth;
}
Truth at_rest(TruthTime time) {
  Truth truth;
  truth.time = time;
  truth.specific_force_B = {0, 0, -9.80665};
  return truth;
}
constexpr PoseMotion motions[] = {{"rest", at_rest}, {"hand", hand_held}};

std::vector<Truth> noisy(const PoseMotion& motion, Nanoseconds duration, const NoiseOfPoses& noise,
                         int rate_hz = 100) {
  std::mt19937_64 random(7);
  const auto unit = [&] { return (static_cast<double>(random() >> 11) + 0.5) * 0x1p-53; };
  const auto normal = [&] { return std::sqrt(-2.0 * std::log(unit())) * std::cos(6.283185307179586 * unit()); };
  const auto vector = [&](double rms) { return Vector3(rms * normal(), rms * normal(), rms * normal()); };
  std::vector<Truth> poses;
  const Nanoseconds step = Nanoseconds{1'000'000'000} / rate_hz;
  for (Nanoseconds t{0}; t <= duration; t += step) {
    const Nanoseconds late = nanoseconds(noise.jitter_s * (2.0 * unit() - 1.0));
    const Truth truth = motion.at(TruthTime{} + t + late);
    Truth pose;
    pose.time = TruthTime{} + t;
    pose.has_rate = false;
    pose.has_position = true;
    pose.r_BN_N = truth.r_BN_N + vector(noise.distance);
    pose.q_NB = truth.q_NB * exp(vector(noise.angle));
    if (unit() >= noise.lost) poses.push_back(pose);
  }
  return poses;
}

// Root mean square of a component, without the first and last tenth of a second.
struct RmsErrors {
  double rate = 0, force = 0;
};
RmsErrors rms_errors(const std::vector<Truth>& derived, const PoseMotion& motion) {
  RmsErrors sum;
  double count = 0;
  for (const Truth& truth : derived) {
    if (truth.time < derived.front().time + 100ms || truth.time > derived.back().time - 100ms) continue;
    const Truth expected = motion.at(truth.time);
    sum.rate += (truth.omega_BN_B - expected.omega_BN_B).squaredNorm();
    sum.force += (truth.q_NB * truth.specific_force_B - expected.q_NB * expected.specific_force_B).squaredNorm();
    count += 3;
  }
  return {std::sqrt(sum.rate / count), std::sqrt(sum.force / count)};
}

// The bounds are 1.5 times what was measured, and below the errors of cubic smoothing splines whose parameter
// minimises the generalised cross validation, of the same noise (SciPy 1.10.1, make_smoothing_spline;
// core/README.md).
TEST(PoseFitChoice, NoiseChoosesAWideWindow) {
  struct {
    const PoseMotion& motion;
    NoiseOfPoses noise;
    RmsErrors bound;
  } const cases[] = {
      {motions[0], {5e-4, 2e-4, 0, 0.05}, {4e-4, 2e-2}},
      {motions[1], {5e-4, 2e-4, 0, 0.05}, {2.2e-3, 1.5e-2}},
      {motions[1], {0, 0, 1e-3, 0.05}, {2.2e-3, 4e-2}},
  };
  for (const auto& c : cases) {
    const auto poses = noisy(c.motion, 6s, c.noise);
    PoseFit fit(chosen);
    const RmsErrors errors = rms_errors(fitted(fit, poses), c.motion);
    EXPECT_LT(errors.rate, c.bound.rate) << c.motion.name;
    EXPECT_LT(errors.force, c.bound.force) << c.motion.name;
    EXPECT_EQ(fit.outliers().count, 0U);
    if (c.noise.angle == 0) continue;
    EXPECT_NEAR(fit.rate_quality().noise, c.noise.angle, 0.1 * c.noise.angle);
    EXPECT_NEAR(fit.force_quality().noise, c.noise.distance, 0.1 * c.noise.distance);
    EXPECT_GT(fit.rate_quality().mean_s, 0.3);
    const RmsErrors fixed = rms_errors(fitted(level, poses), c.motion);
    EXPECT_GT(fixed.rate, 0.03) << "the shortest window";
    EXPECT_GT(fixed.force, 3.0);
  }
}

// A truth that leaves has less noise than the one that came, in what is fitted: attitude, and velocity if it is
// given, otherwise position.
TEST(PoseFitChoice, TheNoiseOfWhatIsGivenIsReduced) {
  constexpr double angle = 5e-4, distance = 2e-4, speed = 1e-2;
  std::mt19937_64 random(8);
  std::normal_distribution<double> normal(0.0, speed);
  for (const bool has_velocity : {false, true}) {
    auto poses = noisy(motions[1], 5s, {angle, distance, 0, 0});
    for (Truth& pose : poses) {
      pose.has_velocity = has_velocity;
      pose.v_BN_N = hand_held(pose.time).v_BN_N + Vector3(normal(random), normal(random), normal(random));
    }
    double attitude = 0, position = 0, velocity = 0, count = 0;
    for (const Truth& truth : fitted(chosen, poses)) {
      if (truth.time < TruthTime{} + 500ms || truth.time > TruthTime{} + 4500ms) continue;
      const Truth expected = hand_held(truth.time);
      attitude += log(truth.q_NB.conjugate() * expected.q_NB).squaredNorm();
      position += (truth.r_BN_N - expected.r_BN_N).squaredNorm();
      velocity += (truth.v_BN_N - expected.v_BN_N).squaredNorm();
      count += 3;
    }
    ASSERT_EQ(count, 3 * 401);
    EXPECT_LT(std::sqrt(attitude / count), 0.5 * angle);
    EXPECT_LT(std::sqrt(position / count), has_velocity ? 1.1 * distance : 0.5 * distance);
    EXPECT_LT(std::sqrt(velocity / count), 0.5 * speed) << has_velocity;
  }
}

// A motion without noise keeps the shortest window, to the last bit.
TEST(PoseFitChoice, AFastMotionWithoutNoiseKeepsTheShortestWindow) {
  const auto poses = poses_of(find_pose_motion("coning"), 100, 5s, false);
  PoseFit fit(chosen);
  const auto derived = fitted(fit, poses), fixed = fitted(level, poses);
  ASSERT_EQ(derived.size(), fixed.size());
  for (std::size_t i = 0; i < fixed.size(); ++i) ASSERT_EQ(derived[i].omega_BN_B, fixed[i].omega_BN_B) << i;
  EXPECT_NEAR(fit.rate_quality().longest_s, 0.03, 1e-12);
}

// A vehicle that begins to turn after a rest: the window is short in time.
TEST(PoseFitChoice, AStepOfTheRateIsFollowed) {
  auto poses = noisy(motions[0], 6s, {1e-5, 1e-5, 0, 0});
  const auto rate = [](double t) { return t < 3.0 ? 0.0 : 1.0 - std::exp(-(t - 3.0) / 0.2); };
  for (Truth& pose : poses) {
    const double t = seconds(pose.time - TruthTime{}) - 3.0;
    if (t > 0) pose.q_NB = exp(Vector3(0, 0, t - 0.2 * (1.0 - std::exp(-t / 0.2)))) * pose.q_NB;
  }
  const auto derived = fitted(chosen, poses);
  double largest = 0;
  for (const Truth& truth : derived)
    largest = std::max(largest, std::abs(truth.omega_BN_B.z() - rate(seconds(truth.time - TruthTime{}))));
  EXPECT_LT(largest, 0.05);
}

// The noise nearby, not the mean of the last half second, tells whether a window is wrong beyond doubt.
TEST(PoseFitChoice, AStepAfterLoudNoiseIsFollowed) {
  auto poses = noisy(motions[0], 4s, {1e-6, 1e-6, 0, 0});
  std::mt19937_64 random(9);
  std::normal_distribution<double> normal(0.0, 5e-3);
  const auto rate = [](double t) { return t < 2.3 ? 0.0 : 1.0 - std::exp(-(t - 2.3) / 0.05); };
  for (Truth& pose : poses) {
    const double t = seconds(pose.time - TruthTime{}), since = t - 2.3;
    if (t < 2.0) pose.q_NB = pose.q_NB * exp(Vector3(normal(random), normal(random), normal(random)));
    if (since > 0) pose.q_NB = exp(Vector3(0, 0, since - 0.05 * (1.0 - std::exp(-since / 0.05)))) * pose.q_NB;
  }
  double largest = 0;
  for (const Truth& truth : fitted(chosen, poses)) {
    const double t = seconds(truth.time - TruthTime{});
    if (t > 2.05) largest = std::max(largest, std::abs(truth.omega_BN_B.z() - rate(t)));
  }
  EXPECT_LT(largest, 0.08);
}

// Four probes of a window fit into a capture that is some 45 ms longer than the window.
TEST(PoseFitChoice, AShortCaptureUsesTheWidestWindowThatFits) {
  struct {
    int steps;
    double before_s, longest_s;  // with one step less, and with these
  } const cases[] = {{20, 0.06, 0.0849}, {29, 0.0849, 0.12}, {53, 0.1697, 0.24}, {101, 0.3394, 0.48}};
  for (const auto& c : cases)
    for (const int less : {1, 0}) {
      PoseFit fit(chosen);
      fitted(fit, noisy(motions[0], (c.steps - less) * 10ms, {5e-4, 2e-4, 0, 0}));
      EXPECT_NEAR(fit.rate_quality().longest_s, less > 0 ? c.before_s : c.longest_s, 1e-4) << c.steps - less;
      EXPECT_NEAR(fit.force_quality().longest_s, less > 0 ? c.before_s : c.longest_s, 1e-4) << c.steps - less;
    }
}

// A simulator's truth is used later by twice the longest delay, whatever is chosen; the first one by three times, as
// its window may lie wholly after it.
TEST(PoseFitChoice, WaitsForTwiceTheLongestDelay) {
  PoseFit::Options options = chosen;
  options.widest = 4;
  for (const NoiseOfPoses& noise : {NoiseOfPoses{}, NoiseOfPoses{5e-4, 2e-4, 0, 0}}) {
    PoseFit fit(options);
    Truth out;
    TruthTime newest, first_at;
    for (const Truth& pose : noisy(motions[1], 4s, noise)) {
      fit.push(pose);
      for (; fit.next(out); newest = out.time)
        if (out.time == TruthTime{}) first_at = pose.time;
      if (pose.time > TruthTime{} + 1s) {
        ASSERT_EQ(pose.time - newest, 240ms);
      }
    }
    EXPECT_EQ(first_at - TruthTime{}, 360ms);
  }
}

TEST(PoseFitChoice, AnOutlierIsRefused) {
  for (const int widest : {0, 8}) {
    PoseFit::Options options = level;
    options.widest = widest;
    for (const double noise : {0.0, 2e-4}) {
      auto poses = noisy(motions[1], 5s, {2.5 * noise, noise, 0, 0});
      poses[4].r_BN_N.x() += 0.05;
      poses[200].r_BN_N.y() -= 0.05;
      poses[300].q_NB = poses[300].q_NB * exp(Vector3(0, 0.2, 0));
      PoseFit fit(options);
      const auto derived = fitted(fit, poses);
      EXPECT_EQ(fit.outliers().count, 3U) << widest << ' ' << noise;
      EXPECT_EQ(fit.outliers().time, poses[300].time);
      EXPECT_NEAR(fit.outliers().angle, 0.2, 0.01);
      ASSERT_EQ(derived.size() + 3, poses.size());
      if (widest == 0) continue;  // up to three truths before have been fitted with it
      const RmsErrors errors = rms_errors(derived, motions[1]);
      EXPECT_LT(errors.rate, 3e-3);
      EXPECT_LT(errors.force, 3e-2);
    }
  }
}

// Neither noise nor any motion, with float32's resolution or without, is taken for an outlier.
TEST(PoseFitChoice, NothingElseIsRefused) {
  PoseFit fit(chosen);
  fitted(fit, noisy(motions[1], 100s, {5e-4, 2e-4, 1e-3, 0.05}));
  EXPECT_EQ(fit.outliers().count, 0U);
  for (const PoseMotion& motion : pose_motion::table)
    for (const bool in_float32 : {false, true}) {
      PoseFit other(level);
      fitted(other, poses_of(motion, 100, 20s, in_float32));
      EXPECT_EQ(other.outliers().count, 0U) << motion.name;
    }
}

TEST(PoseFitChoice, SamplesInAGapAreMarked) {
  auto poses = noisy(motions[1], 4s, {});
  poses.erase(poses.begin() + 200, poses.begin() + 220);
  Timeline timeline;
  for (const Truth& truth : fitted(chosen, poses)) ASSERT_NE(timeline.push(truth), Admission::time_back);
  const auto is_marked = [&](Nanoseconds t) {
    return (timeline.at(TruthTime{} + t).derived & status::truth_gap) != 0;
  };
  EXPECT_FALSE(is_marked(1985ms));
  EXPECT_TRUE(is_marked(1995ms));
  EXPECT_TRUE(is_marked(2100ms));
  EXPECT_TRUE(is_marked(2199ms));
  EXPECT_FALSE(is_marked(2200ms)) << "at a truth";
  EXPECT_FALSE(is_marked(2205ms));
}

// Between two truths, a derived rate is as exact as at them.
TEST(PoseFitChoice, ADerivedRateIsExactBetweenTruths) {
  const PoseMotion& motion = find_pose_motion("aerobatic");
  Timeline timeline;
  for (const Truth& truth : fitted(level, poses_of(motion, 250, 3s, false))) timeline.push(truth);
  double rate = 0, acceleration = 0;
  for (std::int64_t k = 40; k < 560; ++k) {
    const TruthTime time{k * 5'000'000};
    const MotionState state = timeline.at(time);
    const Truth expected = motion.at(time);
    rate = std::max(rate, (state.omega_BN_B - expected.omega_BN_B).norm());
    acceleration = std::max(acceleration, (state.omegaDot_BN_B - expected.omegaDot_BN_B).norm());
    ASSERT_LT(log(state.q_NB.conjugate() * expected.q_NB).norm(), 1e-12);
  }
  EXPECT_LT(rate, 1e-9);
  EXPECT_LT(acceleration, 1e-5);
}

}  // namespace
}  // namespace imud
