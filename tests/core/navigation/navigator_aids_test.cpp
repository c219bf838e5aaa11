// The aids of a unit's own filter beside fixes and magnetic headings.
#include <gtest/gtest.h>

#include <cmath>

#include "tests/core/navigation/navigating.hpp"

namespace imud {
namespace {

NavigatingUnit unit_with_barometer(double rate_hz = 10) {
  NavigatingUnit model = mems_unit();
  model.barometer.noise = 5;  // Pa: 0.4 m
  model.barometer.bias = 900;
  model.navigator.barometer_rate_hz = rate_hz;
  return model;
}

// In an outage of four minutes the free vertical channel drifts by tens of metres; the barometer holds it, whatever
// the weather.
TEST(NavigatorAids, TheBarometerHoldsTheHeight) {
  const auto outage = [](Sample& sample, double t) {
    if (t > 60 && t < 300) lose_fix(sample);
  };
  const auto largest = [&](const NavigatingUnit& model) {
    double height = 0;
    fly(model, 300, outage, [&](const Sample& sample, const Errors& errors, double t) {
      if (t < 60) return;
      height = std::max(height, std::abs(errors.position.z()));
      EXPECT_LT(std::abs(errors.position.z()), 5 * static_cast<double>(sample.solution->position.z())) << t;
    });
    return height;
  };
  EXPECT_GT(largest(unit_with_barometer(0)), 20);
  EXPECT_LT(largest(unit_with_barometer()), 5);
}

// With the random walk of the weather for which the filter allows, its covariance is the one of its errors.
TEST(NavigatorAids, HeightsAreConsistent) {
  NavigatingUnit model = unit_with_barometer();
  model.barometer.noise = 12;  // Pa: 1 m
  MeanSquares mean = mean_squares(model, 10, 40);
  EXPECT_LT(mean.height, 1.6);
  EXPECT_GT(mean.height, 0.4);
}

// A barometer that leaps by 100 m is rejected, and accepted with another offset: the height stays.
TEST(NavigatorAids, ALeapOfTheBarometerIsRejected) {
  const auto leap = [](Sample& sample, double t) {
    if (t > 60) sample.pressure -= 1200;
  };
  double used = 0, rejected = 0;
  const auto look = [&](const Sample& sample, const Errors& errors, double t) {
    if (t < 20) return;
    EXPECT_LT(std::abs(errors.position.z()), 5) << t;
    if (std::abs(t - 60) < 0.2 || std::abs(t - 70) < 0.3) return;
    const bool is_rejected = t > 60 && t < 70;
    EXPECT_EQ(sample.solution->rejected & aid::pressure, is_rejected ? aid::pressure : 0) << t;
    EXPECT_EQ(sample.solution->used & aid::pressure, is_rejected ? 0 : aid::pressure) << t;
  };
  fly(unit_with_barometer(), 100, leap, look, 1, in_time, turn_at, [&](const Navigator& navigator) {
    used = static_cast<double>(navigator.heights().used);
    rejected = static_cast<double>(navigator.heights().rejected);
  });
  EXPECT_NEAR(rejected, 101, 2);
  EXPECT_NEAR(used, 889, 4);
}

// Where the pressure is unknown no height is used.
TEST(NavigatorAids, NoPressureIsNoHeight) {
  const auto lose = [](Sample& sample, double) { sample.pressure = 0; };
  const auto look = [](const Sample&, const Errors&, double) {};
  fly(unit_with_barometer(), 5, lose, look, 1, in_time, turn_at,
      [](const Navigator& navigator) { EXPECT_EQ(navigator.heights().used + navigator.heights().rejected, 0U); });
}

}  // namespace
}  // namespace imud
