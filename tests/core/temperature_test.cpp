// The temperature of the sensor, its measurement, and the polynomials of bias and scale factor, against closed forms.
#include "core/environment/temperature.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "core/imu.hpp"

namespace imud {
namespace {

TEST(Temperature, IsConstantByDefault) {
  const Temperature temperature({}, 31.5);
  EXPECT_FALSE(temperature.is_on());
  EXPECT_EQ(temperature.at(1e6), 31.5);
  EXPECT_EQ(temperature.reported(1e6), 31.5);
}

TEST(Temperature, WarmsUpExponentially) {
  TemperatureModel model;
  model.warm_up_c = 20;
  model.warm_up_s = 300;
  const Temperature temperature(model, 15);
  EXPECT_TRUE(temperature.is_on());
  EXPECT_EQ(temperature.at(0), 15);
  EXPECT_EQ(temperature.at(-5), 15);
  for (const double t : {1.0, 300.0, 1000.0})
    EXPECT_NEAR(temperature.at(t), 15 + 20 * (1 - std::exp(-t / 300)), 1e-12);
  EXPECT_EQ(temperature.at(1e9), 35);
}

TEST(Temperature, FollowsAProfile) {
  TemperatureModel model;
  model.profile_s = {10, 20, 40};
  model.profile_c = {-40, 60, 0};
  const Temperature temperature(model, 99);
  const auto expect = [&](double t, double value) { EXPECT_NEAR(temperature.at(t), value, 1e-12) << t; };
  expect(0, -40);
  expect(10, -40);
  expect(12.5, -15);
  expect(20, 60);
  expect(25, 45);
  expect(40, 0);
  expect(1e9, 0);
  model.warm_up_c = 10;
  model.warm_up_s = 10;
  EXPECT_NEAR(Temperature(model, 99).at(25), 45 + 10 * (1 - std::exp(-2.5)), 1e-12);
}

TEST(Temperature, IsReportedInStepsOfItsRateAndItsLsb) {
  TemperatureModel model;
  model.profile_s = {0, 1000};
  model.profile_c = {0, 1000};  // T = t
  model.offset_c = 0.3;
  model.rate_hz = 10;
  const Temperature exact(model, 0);
  for (int k = 0; k < 1000; ++k) EXPECT_NEAR(exact.reported(0.01 * k), 0.1 * (k / 10) + 0.3, 1e-12) << k;
  model.lsb_c = 0.125;
  const Temperature rounded(model, 0);
  EXPECT_EQ(rounded.reported(0), 0.25);
  EXPECT_EQ(rounded.reported(0.1), 0.375);   // 0.4
  EXPECT_EQ(rounded.reported(0.19), 0.375);  // the same measurement
  EXPECT_EQ(rounded.reported(0.2), 0.5);
  EXPECT_NEAR(rounded.at(0.19), 0.19, 1e-12);
}

TEST(Temperature, OfTheTruthIsReportedInStepsOfItsRate) {
  TemperatureModel model;
  model.profile_s = {0};
  model.profile_c = {5};
  model.from_truth = true;
  model.warm_up_c = 20;
  model.warm_up_s = 300;
  model.offset_c = 0.5;
  model.rate_hz = 10;
  Temperature temperature(model, 15);
  EXPECT_TRUE(temperature.follows_truth());
  const auto warm_up = [](double t) { return 20 * (1 - std::exp(-t / 300)); };
  double reported = 0;
  for (int k = 0; k < 100; ++k) {
    const double t = 0.01 * k, truth_c = -40 + t;
    temperature.update(t, truth_c);
    EXPECT_NEAR(temperature.sensor_c(), truth_c + warm_up(t), 1e-12);
    if (k % 10 == 0) reported = temperature.sensor_c() + 0.5;
    EXPECT_EQ(temperature.reported_c(), reported) << k;
  }
  temperature.update(1, {});  // a truth without a temperature
  EXPECT_NEAR(temperature.sensor_c(), 5 + warm_up(1), 1e-12);
}

// A sensor that was off for a while is still warm; one that was off for long is cold.
TEST(Temperature, OfTheWarmUpRemembersHowLongThePowerWasOff) {
  TemperatureModel model;
  model.warm_up_c = 20;
  model.warm_up_s = 300;
  model.cool_down_s = 500;
  Temperature temperature(model, 25);
  temperature.power_off(600);
  const double warm = 20 * (1 - std::exp(-2.0));
  EXPECT_NEAR(temperature.at(600), 25 + warm, 1e-12);
  EXPECT_NEAR(temperature.at(850), 25 + warm * std::exp(-0.5), 1e-12);
  temperature.power_on(850);
  const double left = warm * std::exp(-0.5);
  EXPECT_NEAR(temperature.at(0), 25 + left, 1e-12);
  EXPECT_NEAR(temperature.at(150), 25 + 20 - (20 - left) * std::exp(-0.5), 1e-12);
  temperature.power_on(150);  // a reset: it stays as warm as it is
  EXPECT_NEAR(temperature.at(0), 25 + 20 - (20 - left) * std::exp(-0.5), 1e-12);
  temperature.power_off(1e6);
  temperature.power_on(2e6);
  EXPECT_NEAR(temperature.at(0), 25, 1e-9);
}

TEST(Temperature, HasTheRateOfItsProfile) {
  TemperatureModel model;
  model.profile_s = {0, 100};
  model.profile_c = {20, 70};
  Temperature temperature(model, 25);
  temperature.update(0, {});
  EXPECT_EQ(temperature.sensor_rate(), 0);
  for (int k = 1; k <= 100; ++k) {
    temperature.update(k, {});
    EXPECT_NEAR(temperature.sensor_rate(), 0.5, 1e-12);
  }
  temperature.update(101, {});
  EXPECT_EQ(temperature.sensor_rate(), 0);
}

// Between two truths it is linear; after the newest it stays.
TEST(TemperatureEffects, FollowTheTruth) {
  ImuModel model;
  model.temperature.from_truth = true;
  model.gyro.temperature_bias << 1e-3, 0, 0, 1e-3, 0, 0, 1e-3, 0, 0;
  Timeline timeline;
  Imu imu(model, 1, 1);
  const auto push = [&timeline](int ms, std::optional<double> temperature_c) {
    Truth truth;
    truth.time = TruthTime{ms * 1'000'000};
    truth.has_temperature = temperature_c.has_value();
    truth.temperature_c = temperature_c.value_or(0);
    timeline.push(truth);
  };
  const auto bias_at = [&](int ms) {
    return imu.sample(timeline, TruthTime{ms * 1'000'000}, DeviceTime{ms * 1'000'000LL}).rate.x();
  };
  push(0, 35);
  EXPECT_NEAR(bias_at(0), 0.010, 1e-15);
  push(100, 45);
  EXPECT_NEAR(bias_at(25), 0.0125, 1e-15);
  EXPECT_NEAR(bias_at(100), 0.020, 1e-15);
  EXPECT_NEAR(bias_at(110), 0.020, 1e-15);
  push(200, std::nullopt);
  push(300, 25);
  EXPECT_NEAR(bias_at(150), 0, 1e-15);  // the constant temperature, 25
  EXPECT_NEAR(bias_at(250), 0, 1e-15);
}

// A sensor in a chamber, whose temperature rises by a degree a second.
TEST(TemperatureEffects, ArePolynomials) {
  ImuModel model;
  model.temperature.profile_s = {0, 100};
  model.temperature.profile_c = {20, 120};
  model.temperature.lsb_c = 50;  // only of what is reported
  model.gyro.reference_temperature_c = 30;
  model.gyro.temperature_bias << 1e-3, 0, 0, 0, 2e-4, 0, 0, 0, -3e-5;
  model.gyro.bias = {0.1, 0.1, 0.1};
  model.accelerometer.temperature_scale << 1e-4, 2e-6, 3e-8, 0, 0, 0, 0, 0, 1e-7;
  model.accelerometer.bias = {5, 5, 5};
  model.rate_hz = 1;
  Timeline timeline;
  Imu imu(model, 1, 1);
  for (int t = 0; t <= 100; ++t) {
    Truth truth;
    truth.time = TruthTime{t * 10'000'000};
    truth.has_specific_force = true;
    truth.specific_force_B = {10, 20, 30};
    timeline.push(truth);
    const Sample sample = imu.sample(timeline, truth.time, DeviceTime{});
    const double x = t - 10.0;  // T - T0 of the gyros; that of the accelerometers is 5 more
    const Vector3 bias(0.1 + 1e-3 * x, 0.1 + 2e-4 * x * x, 0.1 - 3e-5 * x * x * x);
    EXPECT_LT((sample.rate - bias).norm(), 1e-12);
    const double y = t - 5.0;
    const Vector3 scale(1 + 1e-4 * y + 2e-6 * y * y + 3e-8 * y * y * y, 1, 1 + 1e-7 * y * y * y);
    const Vector3 force = scale.cwiseProduct(Vector3(10, 20, 30)) + Vector3::Constant(5);
    EXPECT_LT((sample.specific_force - force).norm(), 1e-10);
    if (t > 0) {
      EXPECT_LT((sample.delta_angle - 0.01 * bias).norm(), 1e-13);
      EXPECT_LT((sample.delta_velocity - 0.01 * force).norm(), 1e-11);
    }
    EXPECT_EQ(sample.temperature_c, t < 5 ? 0 : t < 55 ? 50 : 100);
  }
}

}  // namespace
}  // namespace imud
