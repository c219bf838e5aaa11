// PoseFit: runs of outliers, those near the ends of a segment, and what is none.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "core/attitude.hpp"
#include "core/pose/pose_fit.hpp"
#include "tests/core/pose/pose_motion.hpp"

namespace imud {
namespace {

using namespace std::chrono_literals;

class Normal {
 public:
  Vector3 vector(double rms) { return {rms * next(), rms * next(), rms * next()}; }
  double unit() { return (static_cast<double>(random_() >> 11) + 0.5) * 0x1p-53; }

 private:
  double next() { return std::sqrt(-2.0 * std::log(unit())) * std::cos(6.283185307179586 * unit()); }
  std::mt19937_64 random_{11};
};

// 0.6 s at 100 Hz: slow turns and 0.3 m/s, with noise of `distance` m and 2.5 mrad a mm.
std::vector<Truth> slow(double distance, Normal& normal, int count = 60) {
  std::vector<Truth> poses;
  for (int i = 0; i < count; ++i) {
    const double t = 0.01 * i;
    Truth& pose = poses.emplace_back();
    pose.time = TruthTime{} + i * 10ms;
    pose.has_rate = false;
    pose.has_position = true;
    pose.q_NB = exp(Vector3(0.2 * std::sin(2.0 * t), 0.1 * t, 0)) * exp(normal.vector(2.5 * distance));
    pose.r_BN_N = Vector3(0.3 * t, 0.1 * std::sin(3.0 * t), 1.0) + normal.vector(distance);
  }
  return poses;
}

PoseFit::Options with(int widest) {
  PoseFit::Options options = level;
  options.widest = widest;
  return options;
}

// Wherever in a segment, with noise or without: they are refused, and nothing else.
TEST(PoseFitOutliers, ARunOfUpToThreeIsRefused) {
  Normal normal;
  for (const double noise : {0.0, 1e-4})
    for (std::size_t run = 1; run <= 3; ++run)
      for (std::size_t at = 0; at + run <= 60; ++at) {
        auto poses = slow(noise, normal);
        for (std::size_t i = at; i < at + run; ++i) {
          const double off = i % 2 == 0 ? 0.25 : 0.4;
          poses[i].r_BN_N.y() += off;
        }
        PoseFit fit(with(8));
        const auto derived = fitted(fit, poses);
        ASSERT_EQ(fit.outliers().count, run) << noise << ' ' << run << " from " << at;
        ASSERT_EQ(fit.outliers().time, poses[at + run - 1].time);
        ASSERT_GT(fit.outliers().distance, 0.2);
        for (const Truth& truth : derived) ASSERT_LT(std::abs(truth.r_BN_N.y()), 0.15);
      }
}

TEST(PoseFitOutliers, ARunOfTurnedPosesIsRefused) {
  Normal normal;
  for (const std::size_t at : {0U, 1U, 2U, 30U, 55U, 57U}) {
    auto poses = slow(1e-4, normal);
    for (std::size_t i = at; i < at + 3; ++i) poses[i].q_NB = poses[i].q_NB * exp(Vector3(0, 1.5, 0.4));
    PoseFit fit(with(8));
    fitted(fit, poses);
    EXPECT_EQ(fit.outliers().count, 3U) << at;
    EXPECT_NEAR(fit.outliers().angle, 1.55, 0.1) << at;
    EXPECT_EQ(fit.outliers().distance, 0.0);
  }
}

// With the shortest window, what has been taken already stays.
TEST(PoseFitOutliers, TheRestOfARunIsRefused) {
  Normal normal;
  auto poses = slow(1e-4, normal);
  for (std::size_t i = 30; i < 33; ++i) poses[i].r_BN_N.x() += 0.3;
  PoseFit fit(with(0));
  const auto derived = fitted(fit, poses);
  EXPECT_GE(fit.outliers().count, 1U);
  EXPECT_EQ(derived.size() + fit.outliers().count, poses.size());
}

// The run of the truth begins with the first that is left, and a gap is followed by it.
TEST(PoseFitOutliers, ASegmentBeginsWithWhatIsLeft) {
  Normal normal;
  auto poses = slow(1e-4, normal);
  poses[30].new_run = true;
  poses[30].r_BN_N.x() += 0.3;
  poses[29].r_BN_N.x() += 0.3;
  PoseFit fit(with(8));
  const auto derived = fitted(fit, poses);
  ASSERT_EQ(fit.outliers().count, 2U);
  ASSERT_EQ(derived.size(), 58U);
  EXPECT_EQ(derived[28].time, poses[28].time);
  EXPECT_FALSE(derived[28].new_run);
  EXPECT_EQ(derived[29].time, poses[31].time);
  EXPECT_TRUE(derived[29].new_run);
  for (const Truth& truth : derived) EXPECT_LT(truth.specific_force_B.norm(), 12.0);
}

// Steps of position, velocity, acceleration and rate, anywhere within a capture of 40 poses at 100 and at 10 Hz, and
// at its ends what accelerates by up to 100 m/s^2: no pose is refused.
TEST(PoseFitOutliers, AKinkIsNone) {
  for (const double step_s : {0.01, 0.1})
    for (int kind = 0; kind < 4; ++kind)
      for (double at = 0.03; at < 39.0; at += 0.25) {
        const bool is_near_end = at < 3.0 || at > 36.0;
        if (is_near_end && kind < 2) continue;
        std::vector<Truth> poses;
        for (int i = 0; i < 40; ++i) {
          const double t = step_s * std::max(0.0, i - at);
          Truth& pose = poses.emplace_back();
          pose.time = TruthTime{} + nanoseconds(step_s * i);
          pose.has_rate = false;
          pose.has_position = true;
          pose.r_BN_N = Vector3(kind == 0   ? (t > 0.0 ? 5.0 : 0.0)
                                : kind == 1 ? 8.0 * t
                                : kind == 2 ? 50.0 * t * t
                                            : 0,
                                0, 0);
          pose.q_NB = exp(Vector3(0, 0, kind == 3 ? 2.0 * t * t : 0.0));
        }
        for (const int widest : {0, 8}) {
          PoseFit fit(with(widest));
          fitted(fit, poses);
          ASSERT_EQ(fit.outliers().count, 0U) << kind << " at " << at << ", step " << step_s << ' ' << widest;
        }
      }
}

// Noise alone, in many captures with two ends each: none of 48000 poses is refused.
TEST(PoseFitOutliers, NoiseIsNone) {
  Normal normal;
  for (int capture = 0; capture < 800; ++capture) {
    PoseFit fit(with(0));
    fitted(fit, slow(1e-3, normal));
    ASSERT_EQ(fit.outliers().count, 0U) << capture;
  }
}

}  // namespace
}  // namespace imud
