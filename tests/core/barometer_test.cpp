#include "core/environment/barometer.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "core/imu.hpp"

namespace imud {
namespace {

const Normals normals(5, 6);

TEST(Barometer, LagsBehindAStepOfThePressure) {
  Barometer barometer({.lag_s = 0.5, .bias = 3}, 0.01);
  EXPECT_DOUBLE_EQ(barometer.measure(90'000, normals, 0), 90'003) << "settles on the first sample";
  double measured = 0;
  for (std::uint64_t k = 1; k <= 50; ++k) measured = barometer.measure(91'000, normals, k);
  EXPECT_NEAR(measured, 90'003 + 1000 * (1 - std::exp(-1.0)), 1e-8) << "0.5 s after the step";
  barometer.begin_run();
  EXPECT_DOUBLE_EQ(barometer.measure(80'000, normals, 51), 80'003);
}

TEST(Barometer, HasATemperatureCoefficientDigitsAndARange) {
  Barometer barometer(
      {.temperature_bias = 2, .reference_temperature_c = 20, .lsb = 10, .least = 50'000, .largest = 100'000}, 0.01);
  EXPECT_EQ(barometer.measure(90'000, normals, 0, 20), 90'000);
  EXPECT_EQ(barometer.measure(90'003, normals, 1, 21), 90'010) << "90005, rounded";
  EXPECT_EQ(barometer.measure(200'000, normals, 2, 20), 100'000);
  EXPECT_EQ(barometer.measure(10, normals, 3, 20), 50'000);
}

// 400 units: the sigma of the mean is 1/20 of theirs, and the relative one of their standard deviation 1/28. Five and
// a half of them are a false alarm below 4e-8.
TEST(Barometer, DrawsTheBiasOfAUnit) {
  double sum = 0, square = 0;
  for (std::uint64_t seed = 0; seed < 400; ++seed) {
    Barometer barometer({.bias_sigma = 50}, 0.01);
    const Normals of_unit(seed, 1);
    barometer.draw(of_unit);
    const double bias = barometer.measure(90'000, of_unit, 0) - 90'000;
    EXPECT_EQ(barometer.measure(90'000, of_unit, 1) - 90'000, bias);
    sum += bias / 400;
    square += bias * bias / 400;
  }
  EXPECT_NEAR(sum, 0, 5.5 * 50 / 20);
  EXPECT_NEAR(std::sqrt(square) / 50, 1, 5.5 / 28);
}

// At sea level the density is 1.225 kg/m^3: 100 m/s are 6125 Pa (ISO 2533).
TEST(Barometer, HasAPortInTheFlow) {
  const BarometerErrors errors = {.port = 0.02, .port_per_attack = -0.3, .port_per_sideslip2 = 1.5};
  const auto error = [&](const AirFlow& flow) { return port_error(errors, flow, 101'325); };
  EXPECT_NEAR(error({{100, 0, 0}, std::nullopt, std::nullopt}), 0.02 * 6125, 0.01);
  EXPECT_NEAR(error({{100, 0, 0}, 50, std::nullopt}), 0.02 * 6125 / 4, 0.01);
  EXPECT_NEAR(error({{100, 0, 0}, 50, 1000}), 20, 1e-9);
  const double attack = 0.1, sideslip = -0.2;
  const Vector3 flow(std::cos(attack) * std::cos(sideslip), std::sin(sideslip),
                     std::sin(attack) * std::cos(sideslip));
  EXPECT_NEAR(error({80 * flow, std::nullopt, 1000}), 20 - 30 + 60, 1e-9);
  EXPECT_EQ(error({}), 0);
}

// With n correlation times, the sum of squares has some n degrees of freedom, and its relative standard deviation is
// sqrt(2/n): 0.02 here. Six of them are a false alarm below 1e-8; the correlation's error is smaller.
TEST(Barometer, DriftsWithItsStandardDeviationAndCorrelationTime) {
  constexpr std::uint64_t steps = 500'000, lag = 100;
  Barometer barometer({.drift = 20, .drift_correlation_s = 1}, 0.01);
  std::vector<double> drift;
  for (std::uint64_t k = 0; k < steps; ++k) drift.push_back(barometer.measure(1e5, normals, k) - 1e5);
  double square = 0, product = 0;
  for (std::uint64_t k = 0; k + lag < steps; ++k) {
    square += drift[k] * drift[k];
    product += drift[k] * drift[k + lag];
  }
  EXPECT_NEAR(square / (steps - lag) / 400, 1, 0.12);
  EXPECT_NEAR(product / square, std::exp(-1.0), 0.1);

  Barometer sought({.drift = 20, .drift_correlation_s = 1}, 0.01);
  sought.seek(normals, 1000);
  EXPECT_EQ(sought.measure(1e5, normals, 1000) - 1e5, drift[1000]);
}

// Samples without a known place pass without one of the drift's values being lost.
TEST(Barometer, DriftsOnWhereNoPlaceIsKnown) {
  ImuModel model;
  model.earth.frame = EarthModel::Frame::local;
  model.barometer = {.drift = 20, .drift_correlation_s = 1};
  Truth seeing, blind;
  seeing.has_position = seeing.has_velocity = true;
  const auto third = [&](const Truth& second) {
    Imu imu(model, 1, 1);
    Timeline timeline;
    timeline.push(seeing);
    imu.sample(timeline, {}, {});
    Truth next = second;
    next.time.ns = 10'000'000;
    timeline.push(next);
    imu.sample(timeline, next.time, {});
    next = seeing;
    next.time.ns = 20'000'000;
    timeline.push(next);
    return imu.sample(timeline, next.time, {}).pressure;
  };
  EXPECT_GT(third(seeing), 0);
  EXPECT_EQ(third(blind), third(seeing));
}

}  // namespace
}  // namespace imud
