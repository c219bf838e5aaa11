// PoseFit: any input that may come, and no allocation.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <iterator>
#include <vector>

#include "core/pose/pose_fit.hpp"
#include "tests/core/pose/pose_motion.hpp"
#include "tests/support/allocations.hpp"

namespace imud {
namespace {

using namespace std::chrono_literals;

// A few poses have no window; a single one stands still.
TEST(PoseFitInput, TakesWhatThereIs) {
  for (const std::size_t count : {1U, 2U, 3U, 4U, 5U}) {
    auto poses = poses_of(find_pose_motion("spiral"), 100, 1s, false);
    poses.resize(count);
    const auto derived = fitted(level, poses);
    ASSERT_EQ(derived.size(), count);
    for (const Truth& truth : derived) EXPECT_TRUE(is_finite(truth) && is_in_range(truth));
    if (count == 1)
      EXPECT_LT((derived[0].specific_force_B - Vector3(0, 0, -9.80665)).norm(), 1e-9);
    else
      EXPECT_NEAR(derived[0].omega_BN_B.z(), 0.5, 1e-9);
  }
}

// Turns at constant rate, in rad from one truth to the next. Several of them on one side are beyond half a turn, and
// from 1.89 rad (108 deg) on, two of them are as far away as the nearest turn in the other direction.
TEST(PoseFitInput, FollowsFastSpin) {
  for (const double step : {1.3, 1.5, 1.89, 1.91, 2.0, 2.4, 2.6, 3.1}) {
    std::vector<Truth> poses;
    for (std::int64_t i = 0; i < 300; ++i) {
      Truth pose;
      pose.time.ns = i * 10'000'000;
      pose.has_rate = false;
      pose.q_NB = Eigen::AngleAxisd(step * static_cast<double>(i), Vector3::UnitX());
      poses.push_back(pose);
    }
    const auto derived = fitted(level, poses);
    ASSERT_EQ(derived.size(), poses.size());
    for (const Truth& truth : derived)
      ASSERT_LT((truth.omega_BN_B - Vector3(100 * step, 0, 0)).norm(), 1e-8) << step << ", " << truth.time.ns;
  }
}

TEST(PoseFitInput, AllocatesNothing) {
  const auto poses = poses_of(find_pose_motion("aerobatic"), 1000, 1s, false);
  for (const int widest : {0, 8}) {
    PoseFit::Options options = level;
    options.widest = widest;
    PoseFit fit(options);
    Truth out;
    const std::uint64_t before = allocations();
    for (const Truth& pose : poses) {
      fit.push(pose);
      while (fit.next(out)) continue;
    }
    fit.finish();
    while (fit.next(out)) continue;
    EXPECT_EQ(allocations(), before);
  }
}

// More truths than a window takes, and truths a nanosecond apart.
TEST(PoseFitInput, IsFiniteAtAnyRate) {
  const PoseMotion& motion = find_pose_motion("aerobatic");
  for (const Truth& truth : fitted(level, poses_of(motion, 20'000, 100ms, false)))
    ASSERT_LT((truth.omega_BN_B - motion.at(truth.time).omega_BN_B).norm(), 1e-6);
  auto poses = poses_of(motion, 100, 1s, false);
  poses[50].time = poses[49].time + Nanoseconds{1};
  for (const Truth& truth : fitted(level, poses)) ASSERT_TRUE(is_finite(truth));
}

// Whatever comes, each truth leaves once, in order.
class PoseFitAnyInput : public testing::TestWithParam<int> {};

INSTANTIATE_TEST_SUITE_P(Windows, PoseFitAnyInput, testing::Values(0, 4, 8));

TEST_P(PoseFitAnyInput, IsTaken) {
  std::uint64_t lcg = 7;
  const auto draw = [&lcg](std::uint64_t most) {
    lcg = 6'364'136'223'846'793'005U * lcg + 1'442'695'040'888'963'407U;
    return (lcg >> 33) % most;
  };
  PoseFit fit({.widest = GetParam(), .gravitation = {.kind = GravitationModel::Kind::j2}});
  std::vector<std::int64_t> given, taken;
  Truth truth, out;
  const auto take = [&] {
    while (fit.next(out)) taken.push_back(out.time.ns);
  };
  constexpr std::int64_t steps[] = {1, 1'000, 50'000, 1'000'000, 10'000'000, 3'000'000'000'000};
  std::int64_t step = 1'000'000;
  double scale = 1;
  for (int i = 0; i < 10'000; ++i) {
    if (draw(200) == 0) step = steps[draw(std::size(steps))];
    if (draw(100) == 0) scale = std::pow(10.0, static_cast<double>(draw(31)) - 15);
    const auto number = [&] { return scale * (static_cast<double>(draw(2'000'001)) * 1e-6 - 1.0); };
    truth.time.ns += step;
    truth.new_run = draw(500) == 0;
    if (truth.new_run) truth.time.ns = static_cast<std::int64_t>(draw(1'000'000'000));
    if (draw(100) == 0) truth.has_rate = !truth.has_rate;
    if (draw(100) == 0) truth.has_position = !truth.has_position;
    if (draw(100) == 0) truth.has_velocity = !truth.has_velocity;
    truth.r_BN_N = {number(), number(), number()};
    truth.v_BN_N = 1e-6 * Vector3(number(), number(), number());
    truth.q_NB = Quaternion(number(), number(), number(), scale).normalized();
    given.push_back(truth.time.ns);
    fit.push(truth);
    take();
    if (draw(1000) == 0) fit.finish();
    if (draw(2) == 0) take();
  }
  fit.finish();
  take();
  // Whatever is not taken was an outlier.
  EXPECT_EQ(taken.size() + fit.outliers().count, given.size());
  std::size_t i = 0;
  for (const std::int64_t time : given) i += i < taken.size() && taken[i] == time ? 1 : 0;
  EXPECT_EQ(i, taken.size()) << "the others are in order";
}

}  // namespace
}  // namespace imud
