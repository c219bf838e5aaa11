// Errors that change within a step: the increments have their mean over the step, not the value at its end.
#include <gtest/gtest.h>

#include <cmath>

#include "core/effects/acceleration_sensitivity.hpp"
#include "core/effects/random_walk.hpp"

namespace imud {
namespace {

TEST(StepMeans, GSensitivityIsThatOfTheMeanForce) {
  TriadErrors errors;
  errors.g_sensitivity << 1, 2, 3, 4, 5, 6, 7, 8, 9;
  errors.g_squared_sensitivity = 0.5 * Matrix3::Identity();
  AccelerationSensitivity effect(errors, Quantity::rate, 0.01);
  ASSERT_TRUE(effect.is_on());
  const Normals normals(1, 2);
  const Vector3 force(1, 0, -1), velocity(0.02, 0.01, 0);  // a mean of (2, 1, 0)
  TriadStep step{.normals = normals,
                 .k = 3,
                 .dt = 0.01,
                 .since_power_on = 1,
                 .specific_force = force,
                 .delta_velocity = velocity,
                 .value = lanes(force),
                 .increment = lanes(force)};
  effect.apply(step);
  EXPECT_LT((vector_of(step.error) - Vector3(-2 + 0.5, -2, -2 + 0.5)).norm(), 1e-12);
  EXPECT_LT((vector_of(step.mean_error) - Vector3(4 + 2, 13 + 0.5, 22)).norm(), 1e-12);
}

// Of the mean of a random walk over a step, given both ends: expected value (b1 + b2)/2, variance K^2 T/12. The
// standard error of a variance of 20000 numbers is 1 %.
TEST(StepMeans, TheMeanOfARandomWalkIsBetweenItsEnds) {
  constexpr double period_s = 0.01, density = 3;
  constexpr std::uint64_t count = 20'000;
  TriadErrors errors;
  errors.random_walk_density.setConstant(density);
  RandomWalk walk(errors, Quantity::rate, period_s);
  const Normals normals(5, 7);
  const Vector3 zero = Vector3::Zero();
  Vector3 before = zero;
  double sum = 0, square = 0, to_end = 0;
  for (std::uint64_t k = 0; k < count; ++k) {
    TriadStep step{.normals = normals,
                   .k = k,
                   .dt = period_s,
                   .since_power_on = 0,
                   .specific_force = zero,
                   .delta_velocity = zero,
                   .value = lanes(zero),
                   .increment = lanes(zero)};
    walk.apply(step);
    const double rest = step.mean_error[0] - 0.5 * (before[0] + step.error[0]);
    sum += rest;
    square += rest * rest;
    to_end += (step.mean_error[0] - step.error[0]) * (step.mean_error[0] - step.error[0]);
    before = vector_of(step.error);
  }
  const double variance = density * density * period_s;
  EXPECT_NEAR(sum / count, 0, 4 * std::sqrt(variance / 12 / count));
  EXPECT_NEAR(square / count, variance / 12, 0.05 * variance / 12);
  EXPECT_NEAR(to_end / count, variance / 3, 0.05 * variance / 3) << "half a step, and what is within it: 1/4 + 1/12";
}

}  // namespace
}  // namespace imud
