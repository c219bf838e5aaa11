// The clock of a sensor: closed forms of its wander and of its course with temperature, and of the error of stamps.
#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <vector>

#include "core/clock/oscillator.hpp"
#include "core/clock/stamp_error.hpp"
#include "tests/core/allan.hpp"

namespace imud {
namespace {

// The deviations of the periods from the grid's, s, which a clock counts too short.
std::vector<double> phase_steps(const OscillatorModel& model, const Grid& grid, std::uint64_t seed,
                                std::size_t count) {
  Oscillator oscillator(model, {}, 25, grid);
  const Normals normals(seed, stream_id("imu"));
  std::vector<double> steps;
  for (std::uint64_t k = 0; k < count; ++k) steps.push_back(-seconds(oscillator.next(normals, k, {})));
  return steps;
}

// Counted time over true time less 1, over tau, is the mean of y: its Allan variance is N^2/tau + K^2 tau/3.
void expect_allan_variance(const OscillatorModel& model) {
  const Grid grid(10);
  const double N = model.phase_random_walk, K = model.frequency_random_walk;
  std::map<std::size_t, AllanVariance> variances = {{1, {}}, {4, {}}, {32, {}}, {256, {}}, {2048, {}}};
  for (std::uint64_t seed = 1; seed <= 8; ++seed) {
    const std::vector<double> steps = phase_steps(model, grid, seed, 1 << 16);
    for (auto& [m, variance] : variances) variance.add(steps, m, 0.1);
  }
  for (const auto& [m, variance] : variances) {
    const double tau = 0.1 * static_cast<double>(m), expected = N * N / tau + K * K * tau / 3;
    EXPECT_TRUE(variance.fits(expected, 1e-7)) << tau << " s: " << variance.value() / expected;
  }
}

TEST(Oscillator, HasTheAllanVarianceOfARandomWalkOfFrequency) {
  expect_allan_variance({.frequency_random_walk = 3e-6});
}
TEST(Oscillator, HasTheAllanVarianceOfARandomWalkOfPhase) { expect_allan_variance({.phase_random_walk = 2e-7}); }
TEST(Oscillator, HasBothVariancesAdded) {
  expect_allan_variance({.phase_random_walk = 2e-7, .frequency_random_walk = 1e-6});
}

// y = a (T - T0) + b (T - T0)^2, and the period is the grid's over 1 + y. What rounding leaves never adds up.
TEST(Oscillator, FollowsTheTemperatureWithoutAddingUpRounding) {
  for (const double ppm : {0.0, 300.0})
    for (const double celsius : {-40.0, 20.0, 25.0, 31.0, 85.0}) {
      const Grid grid(819.2, ppm);
      Oscillator oscillator({.temperature_linear = 0.3e-6, .temperature_quadratic = -0.035e-6, .reference_c = 27}, {},
                            celsius, grid);
      const double x = celsius - 27, y = 0.3e-6 * x - 0.035e-6 * x * x;
      const Normals normals(1, 1);
      std::int64_t sum = 0;
      for (std::uint64_t k = 0; k < 1'000'000; ++k) {
        sum += oscillator.next(normals, k, {}).count();
        if (k % 99'991 != 0) continue;
        const double elapsed = static_cast<double>(k + 1) / (819.2 * (1 + 1e-6 * ppm));
        ASSERT_NEAR(static_cast<double>(sum), 1e9 * elapsed * (1 / (1 + y) - 1), 0.51) << celsius << " " << k;
      }
    }
}

// A profile from -20 to 60 degrees in 800 s, with a crystal whose parabola turns at 20 degrees; and a truth's
// temperature in its place.
TEST(Oscillator, FollowsAProfileOrTheTruth) {
  const OscillatorModel crystal = {.temperature_quadratic = -0.04e-6, .reference_c = 20};
  Oscillator oscillator(crystal, {.profile_s = {0, 800}, .profile_c = {-20, 60}}, 25, Grid(100));
  const Normals normals(1, 1);
  double deviation_ns = 0;
  for (std::uint64_t k = 0; k < 80'000; ++k)
    deviation_ns += static_cast<double>(oscillator.next(normals, k, {}).count());
  // (t/10 - 40)^2 from 0 to 800 s has the integral 10 * 2 * 40^3/3.
  EXPECT_NEAR(1e-9 * deviation_ns / (0.04e-6 * 10 * 2 * 64'000 / 3), 1, 1e-4);

  TemperatureModel truth;
  truth.from_truth = true;
  Oscillator of_truth(crystal, truth, 25, Grid(100));
  EXPECT_TRUE(of_truth.follows_truth());
  EXPECT_EQ(of_truth.next(normals, 0, -80.0).count(), 4002) << "0.04 ppm * 100^2 of 10 ms";
}

TEST(Oscillator, IsOffByDefaultAndLimited) {
  EXPECT_FALSE(Oscillator({}, {}, 25, Grid(100)).is_on());
  for (const double linear : {1.0, -1.0}) {
    Oscillator oscillator({.temperature_linear = linear}, {}, 1000, Grid(100));
    EXPECT_TRUE(oscillator.is_on());
    const double y = linear * Oscillator::most;
    EXPECT_NEAR(static_cast<double>(oscillator.next(Normals(1, 1), 0, {}).count()), -1e7 * y / (1 + y), 0.5);
  }
}

// Another model goes on from the wander, and from the time of a profile.
TEST(Oscillator, GoesOnFromAnother) {
  const OscillatorModel model = {.frequency_random_walk = 1e-6, .temperature_linear = 1e-6};
  const TemperatureModel temperature = {.profile_s = {0, 100}, .profile_c = {0, 1000}};
  const Normals normals(3, 3);
  Oscillator whole(model, temperature, 25, Grid(100)), first(model, temperature, 25, Grid(100));
  for (std::uint64_t k = 0; k < 1000; ++k) EXPECT_EQ(whole.next(normals, k, {}), first.next(normals, k, {}));
  Oscillator second(model, temperature, 25, Grid(100));
  second.continue_from(first);
  for (std::uint64_t k = 1000; k < 5000; ++k) EXPECT_EQ(whole.next(normals, k, {}), second.next(normals, k, {})) << k;
}

TEST(StampError, HasTheMeanAndTheVarianceOfItsModel) {
  EXPECT_FALSE(StampError({}).is_on());
  EXPECT_EQ(StampError({.offset_s = -250e-6}).at(Normals(1, 1), 7), -250'000);
  const StampError error({.offset_s = 40e-6, .jitter_s = 15e-6});
  const Normals normals(1, stream_id("imu"));
  constexpr int count = 100'000;
  double sum = 0, square = 0, product = 0, last = 0;
  for (std::uint64_t k = 0; k < count; ++k) {
    const double n = (1e-9 * static_cast<double>(error.at(normals, k)) - 40e-6) / 15e-6;
    sum += n;
    square += n * n;
    product += n * last;
    last = n;
  }
  // 5 standard deviations of each mean.
  EXPECT_NEAR(sum / count, 0, 5 / std::sqrt(count));
  EXPECT_NEAR(square / count, 1, 5 * std::sqrt(2.0 / count));
  EXPECT_NEAR(product / count, 0, 5 / std::sqrt(count)) << "white";
}

}  // namespace
}  // namespace imud
