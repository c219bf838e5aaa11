// PoseFit: its errors, beside a spline's.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "core/pose/pose_fit.hpp"
#include "tests/core/pose/pose_motion.hpp"

namespace imud {
namespace {

using namespace std::chrono_literals;

// The bounds of the table in core/README.md, and the errors of splines through the same poses: RotationSpline and
// CubicSpline of SciPy 1.10.1.
struct FitCase {
  const char* motion;
  int rate_hz;
  bool in_float32;
  FitErrors bound, spline;
};

constexpr FitCase fit_cases[] = {
    {"spiral", 100, false, {1e-13, 2e-9, 1e-13, 2e-9}, {3.2e-14, 2.42e-5, 1e-14, 2.06e-4}},
    {"spiral", 1000, false, {1e-13, 1e-9, 1e-13, 2e-9}, {3.7e-13, 3.24e-7, 3e-13, 2.08e-6}},
    {"spiral", 100, true, {1.11e-5, 0.15, 5.1e-6, 0.06}, {1.11e-5, 0.165, 5.16e-6, 0.0794}},
    {"spiral", 1000, true, {1e-5, 0.08, 8e-6, 0.1}, {1.26e-4, 17.2, 8.84e-5, 18.3}},
    {"coning", 100, false, {5e-8, 1e-13, 5e-8, 1e-13}, {9.17e-6, 1.8e-15, 0.0788, 1.8e-15}},
    {"coning", 1000, false, {5e-11, 1e-13, 1e-10, 2e-12}, {1.73e-10, 1.8e-15, 7.88e-3, 1.8e-15}},
    {"coning", 100, true, {8e-7, 4.6e-8, 3e-6, 4.5e-8}, {9.5e-6, 4.52e-8, 0.0788, 4.52e-8}},
    {"coning", 1000, true, {3e-7, 4e-8, 1.5e-6, 4e-8}, {6.24e-6, 4.52e-8, 7.88e-3, 4.52e-8}},
    {"aerobatic", 100, false, {5e-11, 5e-9, 1e-10, 2e-8}, {3.2e-6, 4.91e-4, 0.0322, 4.12e-3}},
    {"aerobatic", 1000, false, {1e-12, 2e-9, 1e-12, 3e-9}, {6.5e-12, 4.96e-6, 3.22e-3, 4.11e-5}},
    {"aerobatic", 100, true, {1.4e-5, 0.6, 1e-5, 0.2}, {1.41e-5, 0.65, 0.0322, 0.232}},
    {"aerobatic", 1000, true, {1.2e-5, 0.3, 1e-5, 0.4}, {1.35e-4, 72.4, 3.23e-3, 45.5}},
};

TEST(PoseFit, IsWithinTheBoundsOfTheReadme) {
  for (const FitCase& c : fit_cases) {
    const PoseMotion& motion = find_pose_motion(c.motion);
    const auto derived = fitted(level, poses_of(motion, c.rate_hz, 10s, c.in_float32));
    ASSERT_EQ(derived.size(), static_cast<std::size_t>(10 * c.rate_hz + 1));
    const FitErrors errors = errors_of(derived, motion);
    const auto name = testing::Message() << c.motion << ' ' << c.rate_hz << (c.in_float32 ? " float32" : " double");
    // The bound, and no worse than the spline. Differences below 1e-13 rad/s, which are rounding, and below 2e-12
    // m/s^2, gravitation turned by 2e-13 rad, do not count.
    const auto expect_below = [&name](double error, double bound, double spline, double rounding) {
      EXPECT_LT(error, bound) << name;
      EXPECT_LT(error, std::max(1.01 * spline, rounding)) << name;
    };
    expect_below(errors.rate, c.bound.rate, c.spline.rate, 1e-13);
    expect_below(errors.end_rate, c.bound.end_rate, c.spline.end_rate, 1e-13);
    expect_below(errors.force, c.bound.force, c.spline.force, 2e-12);
    expect_below(errors.end_force, c.bound.end_force, c.spline.end_force, 2e-12);
    for (const Truth& truth : derived)
      ASSERT_TRUE(truth.has_rate && truth.is_rate_derived && truth.has_angular_acceleration &&
                  truth.is_force_derived && truth.has_specific_force && truth.has_velocity && is_finite(truth) &&
                  is_in_range(truth))
          << name;
  }
}

// The ends of a turn at constant rate, for which the spline's end condition, no angular acceleration, is true: the
// root mean square, over 40 pieces of 0.3 s, of the largest error in the first and last 60 ms.
TEST(PoseFit, IsNoWorseThanASplineAtTheEndsOfATurntable) {
  struct EndCase {
    int rate_hz;
    double spline;  // rad/s, SciPy 1.10.1
  };
  for (const EndCase& c : {EndCase{50, 2.57e-6}, {100, 5.03e-6}, {150, 8.20e-6}, {400, 2.43e-5}}) {
    const PoseMotion& motion = find_pose_motion("spiral");
    const auto poses = poses_of(motion, c.rate_hz, 10s, true);
    double square = 0.0;
    for (std::ptrdiff_t piece = 0; piece < 40; ++piece) {
      const auto begin = poses.begin() + piece * c.rate_hz / 5;
      const double error =
          errors_of(fitted(level, std::vector<Truth>(begin, begin + 3 * c.rate_hz / 10 + 1)), motion).end_rate;
      square += error * error / 40.0;
    }
    EXPECT_LT(std::sqrt(square), 0.9 * c.spline) << c.rate_hz;
  }
}

}  // namespace
}  // namespace imud
