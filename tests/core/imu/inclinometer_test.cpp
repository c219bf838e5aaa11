// Inclinometers: the specific force, with errors and random numbers of their own, in a sensor that is otherwise as
// without them.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <vector>

#include "core/effects/drawn_errors.hpp"
#include "core/imu.hpp"
#include "core/units.hpp"
#include "tests/core/drive.hpp"

namespace imud {
namespace {

using namespace std::chrono_literals;

constexpr double g = units::standard_gravity;

// Accelerometers and inclinometers with the same errors.
ImuModel alike(const TriadErrors& errors) {
  ImuModel model;
  model.rate_hz = 1000;
  model.accelerometer = errors;
  model.inclinometer = errors;
  return model;
}

// Samples of a sensor at rest, from the one of that number on.
std::vector<Sample> at_rest(const ImuModel& model, std::uint64_t count, std::uint64_t from = 0) {
  Imu imu(model, 3, stream_id("imu"));
  if (from > 0) imu.seek(from);
  std::vector<Sample> samples;
  for (std::uint64_t k = from; k < count; ++k)
    samples.push_back(imu.sample_at_rest(static_cast<std::int64_t>(k) * 1ms, DeviceTime{}));
  return samples;
}

TEST(Inclinometers, WithoutErrorsMeasureTheForce) {
  ImuModel model = alike({});
  model.r_SB_B = {0.1, -0.2, 0.3};
  model.dcm_PB << 0, 1, 0, -1, 0, 0, 0, 0, 1;
  const std::vector<TruthTime> times = instants(1000, 1s);
  std::size_t moving = 0;
  for (const Sample& sample : drive(model, coning_truth, times, times)) {
    ASSERT_TRUE(sample.inclination);
    EXPECT_EQ(*sample.inclination, sample.specific_force);
    moving += sample.specific_force.isZero(0.0) ? 0U : 1U;
  }
  EXPECT_GT(moving, 900U);
  model.inclinometer.reset();
  EXPECT_FALSE(drive(model, coning_truth, times, times).front().inclination);
}

// With independent noise the correlation of N samples of two sensors is N(0, 1)/sqrt(N). None of the nine pairs of
// axes exceeds 6/sqrt(N), but for a chance of 2e-8; where both sensors had the same numbers, three would be 1.
TEST(Inclinometers, HaveNoiseOfTheirOwn) {
  TriadErrors noise;
  noise.white_density = Vector3::Constant(1e-3);
  constexpr int count = 20'000;
  const Vector3 force = at_rest(alike({}), 1).front().specific_force;
  Matrix3 products = Matrix3::Zero();
  Vector3 accelerometers = Vector3::Zero(), inclinometers = Vector3::Zero();
  for (const Sample& sample : at_rest(alike(noise), count)) {
    const Vector3 a = sample.specific_force - force, i = *sample.inclination - force;
    products += a * i.transpose();
    accelerometers += a.cwiseAbs2();
    inclinometers += i.cwiseAbs2();
  }
  for (int row = 0; row < 3; ++row)
    for (int column = 0; column < 3; ++column)
      EXPECT_LT(std::abs(products(row, column)) / std::sqrt(accelerometers[row] * inclinometers[column]),
                6 / std::sqrt(count))
          << row << column;
  // The relative deviation of a standard deviation is 1/sqrt(2 N); 6 of them by chance with 6e-9.
  const double sigma = 1e-3 * std::sqrt(1000.0);
  for (int axis = 0; axis < 3; ++axis)
    EXPECT_NEAR(std::sqrt(inclinometers[axis] / count), sigma, 6 * sigma / std::sqrt(2.0 * count)) << axis;
}

// Bytes of gyros, accelerometers and the rest: with errors that have a memory, at rest, in motion, in a simulator
// that stands still, with internal samples, filters and a sampling jitter.
TEST(Inclinometers, LeaveTheOtherSensorsAsTheyAre) {
  TriadErrors errors;
  errors.white_density = Vector3(1e-3, 2e-3, 3e-3);
  errors.bias_instability = Vector3::Constant(1e-4);
  errors.random_walk_density = Vector3::Constant(1e-4);
  errors.turn_on_bias = Vector3::Constant(0.1);
  errors.unit_sigma.scale_factor = Vector3::Constant(1e-3);
  errors.lsb = 1e-3;
  errors.increment_lsb = 1e-6;
  errors.max = 12;
  const auto run = [](const ImuModel& model) {
    Imu imu(model, 5, stream_id("imu"));
    std::vector<Sample> samples;
    for (int k = 0; k < 20; ++k) samples.push_back(imu.sample_at_rest(k * 1ms, DeviceTime{}));
    imu.power_on(1);
    imu.begin_run();
    Timeline timeline;
    for (int ms = 0; ms <= 400; ms += 10) {
      timeline.push(coning_truth(TruthTime{} + ms * 1ms));
      for (int k = ms - 9; k <= ms; ++k)
        if (k >= 0) samples.push_back(imu.sample(timeline, TruthTime{} + k * 1ms, DeviceTime{}));
      if (ms == 200)
        for (int k = 0; k < 30; ++k) samples.push_back(imu.sample(timeline, TruthTime{} + 200ms, DeviceTime{}));
      imu.advance(timeline, TruthTime{} + ms * 1ms);
    }
    return samples;
  };
  const std::vector<std::function<void(ImuModel&)>> variants = {
      [](ImuModel&) {},
      [](ImuModel& model) { model.internal_samples = 3; },
      [](ImuModel& model) {
        model.gyro.filter.cut_off_hz = model.accelerometer.filter.cut_off_hz = {50, 60, 70};
      },
      [](ImuModel& model) { model.sampling_jitter = 200us; },
      [](ImuModel& model) { model.sampling_delay = 3ms; },
      [](ImuModel& model) { model.accelerometer_positions = 0.01 * Matrix3::Identity(); }};
  for (std::size_t variant = 0; variant < variants.size(); ++variant) {
    ImuModel model = alike(errors);
    model.gyro = model.magnetometer = errors;
    variants[variant](model);
    const std::vector<Sample> with = run(model);
    model.inclinometer.reset();
    const std::vector<Sample> without = run(model);
    ASSERT_EQ(with.size(), 20U + 401U + 30U);
    for (std::size_t k = 0; k < with.size(); ++k) {
      SCOPED_TRACE(testing::Message() << "variant " << variant << ", sample " << k);
      ASSERT_EQ(with[k].rate, without[k].rate);
      ASSERT_EQ(with[k].specific_force, without[k].specific_force);
      ASSERT_EQ(with[k].delta_angle, without[k].delta_angle);
      ASSERT_EQ(with[k].delta_velocity, without[k].delta_velocity);
      ASSERT_EQ(with[k].magnetic_field, without[k].magnetic_field);
      ASSERT_EQ(with[k].counter, without[k].counter);
      ASSERT_EQ(with[k].status & ~(7U * status::inclinometer_saturated_x), without[k].status);
      ASSERT_TRUE(with[k].inclination && *with[k].inclination != with[k].specific_force);
    }
  }
}

TEST(Inclinometers, SaturateAlone) {
  ImuModel model = alike({});
  model.inclinometer->max = 0.5 * g;
  const std::vector<TruthTime> times = instants(1000, 10ms);
  const auto turning = [](TruthTime time) {
    Truth truth;
    truth.time = time;
    truth.has_specific_force = true;
    truth.specific_force_B = Vector3(0.4, 0.6, -3) * g;
    return truth;
  };
  const Sample sample = drive(model, turning, times, times).back();
  EXPECT_EQ(*sample.inclination, Vector3(0.4, 0.5, -0.5) * g);
  EXPECT_EQ(sample.specific_force, Vector3(0.4, 0.6, -3) * g);
  EXPECT_EQ(sample.status, 6U * status::inclinometer_saturated_x);
}

// A sample has the errors of its number, and a sensor with other parameters goes on from the errors of the one
// before.
TEST(Inclinometers, GoOnWithTheirErrors) {
  TriadErrors errors;
  errors.white_density = Vector3::Constant(1e-3);
  errors.random_walk_density = Vector3::Constant(1e-2);
  const ImuModel model = alike(errors);
  const std::vector<Sample> all = at_rest(model, 200);
  EXPECT_EQ(*at_rest(model, 121, 120).front().inclination, *all[120].inclination);
  Imu first(model, 3, stream_id("imu")), second(model, 3, stream_id("imu"));
  for (int k = 0; k < 100; ++k) first.sample_at_rest(k * 1ms, DeviceTime{});
  second.continue_from(first);
  EXPECT_EQ(*second.sample_at_rest(100ms, DeviceTime{}).inclination, *all[100].inclination);
  second.set_seed(4);
  EXPECT_NE(*second.sample_at_rest(101ms, DeviceTime{}).inclination, *all[101].inclination);
}

// Inclinometers and accelerometers draw different constant errors, but a cause may determine both.
TEST(Inclinometers, HaveDrawsOfTheirOwn) {
  TriadErrors errors;
  errors.unit_sigma.bias = Vector3::Constant(0.01);
  ImuModel model = alike(errors);
  const Vector3 force = at_rest(alike({}), 1).front().specific_force;
  const auto biases = [&] {
    const Sample sample = at_rest(model, 1).front();
    return std::pair<Vector3, Vector3>(sample.specific_force - force, *sample.inclination - force);
  };
  const auto [accelerometer, inclinometer] = biases();
  const Normals normals(3, stream_id("imu"));
  EXPECT_LT((inclinometer - drawn_for_unit(errors, Quantity::inclination, normals).bias).norm(), 1e-12);
  EXPECT_GT((inclinometer - accelerometer).cwiseAbs().minCoeff(), 1e-5);
  Cause cause;
  cause.name = "stress";
  cause.accelerometer.bias = cause.inclinometer.bias = Vector3::Ones();
  model.causes = {cause};
  const auto [caused, same] = biases();
  EXPECT_LT((caused - same).norm(), 1e-12);
  EXPECT_GT(caused.norm(), 1e-5);
}

}  // namespace
}  // namespace imud
