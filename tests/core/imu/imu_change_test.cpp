// Changes of a sensor between two samples: bias, seed, and the true motion that a sample had.
#include <gtest/gtest.h>

#include "core/imu.hpp"

namespace imud {
namespace {

Sample rest_sample(Imu& imu, int k) {
  return imu.sample_at_rest(Nanoseconds{10'000'000 * k}, DeviceTime{10'000'000 * k});
}

ImuModel noisy_model() {
  ImuModel model;
  model.gyro.white_density = Vector3::Constant(1e-3);
  model.gyro.walk_transition = Matrix3::Zero();
  model.gyro.walk_sqrt_cov = 1e-3 * Matrix3::Identity();
  model.accelerometer.white_density = Vector3::Constant(1e-2);
  return model;
}

TEST(ImuChange, BiasActsFromTheNextSampleOn) {
  ImuModel biased_model = noisy_model();
  biased_model.gyro.bias = {0.1, 0.2, 0.3};
  Imu changed(noisy_model(), 1, 2), plain(noisy_model(), 1, 2), biased(biased_model, 1, 2);
  for (int k = 0; k < 40; ++k) {
    if (k == 17) changed.set_bias(Quantity::rate, {0.1, 0.2, 0.3});
    const Sample a = rest_sample(plain, k), b = rest_sample(biased, k), c = rest_sample(changed, k);
    EXPECT_EQ(c.rate, (k < 17 ? a : b).rate) << k;
    EXPECT_EQ(c.delta_angle, (k < 17 ? a : b).delta_angle) << k;
    EXPECT_EQ(c.specific_force, a.specific_force) << k;
  }
  EXPECT_EQ(changed.bias(Quantity::rate), Vector3(0.1, 0.2, 0.3));
  EXPECT_EQ(changed.bias(Quantity::specific_force), Vector3::Zero());
}

// 21 is in the middle of the 16 samples whose numbers are computed at once.
TEST(ImuChange, SeedGivesItsNumbersFromTheNextSampleOn) {
  Imu changed(noisy_model(), 1, 2), first(noisy_model(), 1, 2), second(noisy_model(), 9, 2);
  for (int k = 0; k < 60; ++k) {
    if (k == 21) changed.set_seed(9);
    const Sample a = rest_sample(first, k), b = rest_sample(second, k), c = rest_sample(changed, k);
    EXPECT_NE(a.rate, b.rate);
    EXPECT_EQ(c.rate, (k < 21 ? a : b).rate) << k;
    EXPECT_EQ(c.specific_force, (k < 21 ? a : b).specific_force) << k;
  }
}

TEST(ImuChange, TrueMotionHasNoErrors) {
  ImuModel model = noisy_model();
  model.gyro.bias = Vector3::Ones();
  model.gyro.scale_factor = Vector3::Constant(2);
  model.gyro.max = 0.5;
  Imu imu(model, 1, 2), ideal(ImuModel{}, 1, 2);
  EXPECT_EQ(imu.true_rate(), Vector3::Zero());
  Timeline timeline;
  for (int i = 0; i < 3; ++i) {
    Truth truth;
    truth.time = TruthTime{10'000'000 * i};
    truth.omega_BN_B = {0.1, -0.2, 0.3 * i};
    truth.has_specific_force = true;
    truth.specific_force_B = {1, 2, 9.8};
    timeline.push(truth);
    const Sample measured = imu.sample(timeline, truth.time, DeviceTime{truth.time.ns});
    const Sample expected = ideal.sample(timeline, truth.time, DeviceTime{truth.time.ns});
    EXPECT_NE(measured.rate, expected.rate);
    EXPECT_EQ(imu.true_rate(), expected.rate);
    EXPECT_EQ(imu.true_specific_force(), expected.specific_force);
  }
}

}  // namespace
}  // namespace imud
