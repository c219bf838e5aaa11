// A sensor takes the place of another one between two samples.
#include <gtest/gtest.h>

#include <cmath>

#include "core/imu.hpp"

namespace imud {
namespace {

constexpr int change_at = 2345, samples = 4000;

Sample sample_at(Imu& imu, int k) {
  const std::int64_t ns = 10'000'000 * std::int64_t{k};
  return imu.sample_at_rest(Nanoseconds{ns}, DeviceTime{ns});
}

// Every effect with a memory.
ImuModel model_with_memory() {
  ImuModel model;
  for (TriadErrors* errors : {&model.gyro, &model.accelerometer}) {
    errors->bias_instability = Vector3::Constant(1e-3);
    errors->correlated_sigma = Vector3::Constant(1e-3);
    errors->correlation_time = Vector3::Constant(20);
    errors->random_walk_density = Vector3::Constant(1e-4);
    errors->turn_on_bias = Vector3::Constant(1e-2);
    errors->walk_sqrt_cov = 1e-5 * Matrix3::Identity();
    errors->filter.cut_off_hz = Vector3::Constant(10);
    errors->lsb = 1e-4;
    errors->carry = true;
    errors->increment_lsb = 1e-6;
    errors->ramp = Vector3::Constant(1e-4);
  }
  model.vibration.sines.push_back({.frequency_hz = 7, .force = {1, 2, 3}, .rate = {0.1, 0.2, 0.3}});
  model.temperature.warm_up_c = 10;
  model.gyro.temperature_bias.col(0) = Vector3::Constant(1e-3);
  return model;
}

void expect_equal(const Sample& a, const Sample& b, int k) {
  ASSERT_EQ(a.rate, b.rate) << k;
  ASSERT_EQ(a.specific_force, b.specific_force) << k;
  ASSERT_EQ(a.delta_angle, b.delta_angle) << k;
  ASSERT_EQ(a.delta_velocity, b.delta_velocity) << k;
  ASSERT_EQ(a.counter, b.counter) << k;
  ASSERT_EQ(a.temperature_c, b.temperature_c) << k;
}

TEST(ImuContinue, TheSameModelGoesOnAsIfNothingHadHappened) {
  for (const int internal : {1, 4}) {
    ImuModel model = model_with_memory();
    model.internal_samples = internal;
    Imu plain(model, 1, 2), before(model, 1, 2), after(model, 1, 2);
    for (Imu* imu : {&plain, &before}) imu->power_on(3);
    for (int k = 0; k < samples; ++k) {
      if (k == change_at) after.continue_from(before);
      const Sample a = sample_at(plain, k), b = sample_at(k < change_at ? before : after, k);
      ASSERT_NO_FATAL_FAILURE(expect_equal(a, b, k));
    }
  }
}

TEST(ImuContinue, ItsOwnParametersActFromTheNextSampleOn) {
  ImuModel other = model_with_memory();
  other.gyro.bias = {0.1, 0.2, 0.3};
  other.gyro.lsb = other.gyro.increment_lsb = 0;
  ImuModel first = model_with_memory();
  first.gyro.lsb = first.gyro.increment_lsb = 0;
  first.gyro.filter = other.gyro.filter = {};
  Imu plain(first, 1, 2), before(first, 1, 2), after(other, 1, 2);
  for (int k = 0; k < samples; ++k) {
    if (k == change_at) after.continue_from(before);
    const Sample a = sample_at(plain, k), b = sample_at(k < change_at ? before : after, k);
    const Vector3 bias = k < change_at ? Vector3::Zero() : other.gyro.bias;
    ASSERT_LT((b.rate - a.rate - bias).norm(), 1e-12) << k;
    ASSERT_EQ(b.specific_force, a.specific_force) << k;
  }
}

// In proportion to their parameters, without a step.
TEST(ImuContinue, ErrorsWithAMemoryGoOnFromTheirValues) {
  ImuModel first, other;
  first.gyro.correlated_sigma = first.gyro.bias_instability = Vector3::Constant(1);
  first.accelerometer.random_walk_density = Vector3::Constant(1);
  other = first;
  other.gyro.correlated_sigma = other.gyro.bias_instability = Vector3::Constant(2);
  other.accelerometer.random_walk_density = Vector3::Zero();
  other.accelerometer.random_walk_density.x() = 1e-9;
  Imu plain(first, 1, 2), before(first, 1, 2), after(other, 1, 2);
  Vector3 walk = Vector3::Zero();
  for (int k = 0; k < samples; ++k) {
    if (k == change_at) after.continue_from(before);
    const Sample a = sample_at(plain, k), b = sample_at(k < change_at ? before : after, k);
    if (k < change_at) walk = b.specific_force;
    if (k < change_at) continue;
    ASSERT_LT((b.rate - 2 * a.rate).norm(), 1e-12) << k;
    ASSERT_LT((b.specific_force - walk).norm(), 1e-6) << k;
  }
}

// Noise that begins is stationary from the first sample on.
TEST(ImuContinue, ANoiseThatBeginsIsStationary) {
  const auto mean_square = [](const ImuModel& model) {
    constexpr int many = 300, begin = 33;
    double sum = 0;
    for (std::uint64_t seed = 0; seed < many; ++seed) {
      Imu before(ImuModel{}, seed, 2), after(model, seed, 2);
      for (int k = 0; k < begin; ++k) EXPECT_EQ(sample_at(before, k).rate, Vector3::Zero());
      after.continue_from(before);
      sum += sample_at(after, begin).rate.squaredNorm() / (3 * many);
    }
    return sum;
  };
  ImuModel correlated, flicker;
  correlated.gyro.correlated_sigma = Vector3::Constant(1);
  correlated.gyro.correlation_time = Vector3::Constant(1e6);
  EXPECT_NEAR(mean_square(correlated), 1, 0.2);
  flicker.gyro.bias_instability = Vector3::Constant(1);
  const auto octaves = static_cast<double>(Flicker::octaves(flicker.gyro.flicker_from_s, flicker.gyro.flicker_to_s));
  const double variance = 0.22063560015265482 * (octaves + 2);  // ln2/pi for each octave, and the borders twice
  EXPECT_NEAR(mean_square(flicker), variance, 0.2 * variance);
}

}  // namespace
}  // namespace imud
