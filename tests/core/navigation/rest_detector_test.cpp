#include "core/navigation/rest_detector.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "core/units.hpp"

namespace imud {
namespace {

constexpr double detector_step_s = 0.01, gravity = units::standard_gravity;

// Whether a window is rest, by the rate and the specific force at its steps.
template <class RateAt, class ForceAt>
bool is_rest(RateAt rate_at, ForceAt force_at, const InertialNoise& noise = {}) {
  RestDetector detector(noise);
  for (int k = 0; k < 99; ++k) {
    const double t = detector_step_s * k;
    EXPECT_FALSE(detector.add(detector_step_s * rate_at(t), detector_step_s * force_at(t), detector_step_s, gravity))
        << k;
  }
  const std::optional<bool> found =
      detector.add(detector_step_s * rate_at(0.99), detector_step_s * force_at(0.99), detector_step_s, gravity);
  EXPECT_TRUE(found);
  return found.value_or(false);
}

Vector3 still(double) { return Vector3::Zero(); }
Vector3 heavy(double) { return {0, 0.2 * gravity, -std::sqrt(0.96) * gravity}; }
double sine(double t) { return std::sqrt(2.0) * std::sin(2 * units::pi * 10 * t); }  // RMS 1

TEST(RestDetector, FindsRest) {
  EXPECT_TRUE(is_rest(still, heavy));
  EXPECT_TRUE(is_rest([](double t) { return Vector3(0, 0.003 * sine(t), 0); }, heavy));
  EXPECT_TRUE(is_rest(still, [](double t) { return Vector3(0.04 * sine(t), 0, -gravity); }));
}

TEST(RestDetector, EachLimitCounts) {
  EXPECT_FALSE(is_rest([](double) { return Vector3(0, 0, 0.005); }, heavy)) << "turns";
  EXPECT_FALSE(is_rest([](double t) { return Vector3(0, 0.005 * sine(t), 0); }, heavy)) << "shakes";
  EXPECT_FALSE(is_rest(still, [](double t) { return Vector3(0.06 * sine(t), 0, -gravity); })) << "vibrates";
  EXPECT_FALSE(is_rest(still, [](double) { return Vector3(0, 0, -gravity - 0.35); })) << "climbs faster";
}

// The noise of the sensors is no motion.
TEST(RestDetector, AllowsForNoise) {
  const auto rate = [](double t) { return Vector3(0.02 * sine(t), 0, 0); };
  const auto force = [](double t) { return Vector3(0, 0, -gravity + 0.2 * sine(t)); };
  EXPECT_FALSE(is_rest(rate, force));
  EXPECT_TRUE(is_rest(
      rate, force, {.gyro = 0.02 * std::sqrt(detector_step_s), .accelerometer = 0.2 * std::sqrt(detector_step_s)}));
}

}  // namespace
}  // namespace imud
