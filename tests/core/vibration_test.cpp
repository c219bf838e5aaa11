// Vibration on a shaker, against closed forms: sines and their integrals, the power of a random spectrum, and the
// rectification of the accelerometers.
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "core/imu.hpp"
#include "core/units.hpp"
#include "tests/core/drive.hpp"

namespace imud {
namespace {

using namespace std::chrono_literals;

constexpr double pi = units::pi;

// Samples of a vehicle that stands still for a second, in free fall.
std::vector<Sample> still(const ImuModel& model, double rate_hz, std::uint64_t seed = 1) {
  return drive(
      model,
      [](TruthTime t) {
        Truth truth;
        truth.time = t;
        truth.has_specific_force = true;
        return truth;
      },
      instants(50, 1s), instants(rate_hz, 1s), seed);
}

TEST(Vibration, OfAShakerIsASineWhoseIntegralIsExact) {
  ImuModel model;
  const Vector3 force(30, -5, 1), rate(0.5, 0.1, -0.2);
  constexpr double phase = 0.7;
  // Beyond half the sample rate, too.
  for (const double frequency : {0.01, 50.0, 333.3, 1234.5}) {
    model.vibration.sines = {{.frequency_hz = frequency, .force = force, .rate = rate, .phase = phase}};
    const std::vector<Sample> samples = still(model, 700);
    ASSERT_EQ(samples.size(), 701U);
    const double omega = 2 * pi * frequency;
    double t1 = 0;
    for (const Sample& sample : samples) {
      const double t2 = seconds(sample.time - DeviceTime{});
      const double now = std::sin(omega * t2 + phase);
      // The frequency is rounded to 5.4e-11 Hz: 1.7e-10 rad after a second.
      EXPECT_LT((sample.specific_force - now * force).norm(), 2e-10 * force.norm());
      EXPECT_LT((sample.rate - now * rate).norm(), 2e-10 * rate.norm());
      const double integral = (std::cos(omega * t1 + phase) - std::cos(omega * t2 + phase)) / omega;
      EXPECT_LT((sample.delta_velocity - integral * force).norm(), 1e-11);
      EXPECT_LT((sample.delta_angle - integral * rate).norm(), 2e-13);
      t1 = t2;
    }
  }
}

// 1e9 s, some 30 years, after truth time 0, the phase has lost nothing.
TEST(Vibration, KeepsItsPhaseForYears) {
  ImuModel model;
  model.vibration.sines = {{.frequency_hz = 125, .force = {1, 0, 0}, .phase = 0.25}};
  Timeline timeline;
  Imu imu(model, 1, 1);
  Truth truth;
  truth.time = TruthTime{} + 1'000'000'000s;
  timeline.push(truth);
  truth.time = truth.time + 1ms;
  timeline.push(truth);
  const double first = imu.sample(timeline, truth.time - 1ms, {}).specific_force.x();
  const Sample second = imu.sample(timeline, truth.time, {});
  // 2^-64 turns per ns, rounded, are 2.7e-11 Hz: at most 0.17 rad in 1e9 s. From one sample to the next it is exact.
  const double begin = std::asin(first), step = 2 * pi * 0.125;
  EXPECT_NEAR(begin, 0.25, 0.17);
  EXPECT_NEAR(second.specific_force.x(), std::sin(begin + step), 1e-9);
  EXPECT_NEAR(second.delta_velocity.x(), (std::cos(begin) - std::cos(begin + step)) / (2 * pi * 125), 1e-12);
}

TEST(Vibration, OfOneFrequencyAddsUp) {
  VibrationModel model;
  model.sines = {{.frequency_hz = 50, .force = {3, 0, 0}}, {.frequency_hz = 50, .force = {4, 0, 0}, .phase = pi / 2}};
  EXPECT_NEAR(Vibration(model, Normals(1, 1)).mean_square().x(), 12.5, 1e-12);
}

// The area below the breakpoints, by hand: rising by 3 dB, flat, falling by 3 dB and by 6 dB an octave.
TEST(Vibration, HasThePowerOfItsSpectrum) {
  ImuModel model;
  VibrationModel::Spectrum& spectrum = model.vibration.spectrum;
  spectrum.frequency_hz = {20, 80, 350, 700, 2000};
  spectrum.force = {0.25, 1, 1, 0.5, 0.5 * 0.35 * 0.35};
  spectrum.rate = {1e-4, 4e-4, 4e-4, 2e-4, 0.245e-4};
  spectrum.axes = {1, 2, 0};
  const double area = 0.5 * (80 - 20 * 0.25) + 270 + 350 * std::log(2.0) + 0.5 * 700 * (1 - 0.35);
  for (const std::size_t lines : {1U, 7U, 64U, 500U}) {
    spectrum.lines = lines;
    const Vector3 mean = Vibration(model.vibration, Normals(1, 1)).mean_square();
    EXPECT_LT((mean - area * Vector3(1, 4, 0)).norm(), 1e-9 * area) << lines;
  }
  // The mean over a second: the lines are at least 1.4 Hz apart, so that it is within a few percent of that over all
  // time. Seeds are fixed; the axes and the seeds have phases of their own.
  spectrum.lines = 64;
  double squares = 0, angular = 0, product = 0, other = 0;
  const std::vector<Sample> one = still(model, 5000), two = still(model, 5000, 2);
  for (std::size_t k = 0; k < 5000; ++k) {
    const Vector3 force = one[k].specific_force;
    squares += force.x() * force.x() / 5000;
    product += force.x() * force.y() / 5000;
    angular += one[k].rate.x() * one[k].rate.x() / 5000;
    other += force.x() * two[k].specific_force.x() / 5000;
    EXPECT_EQ(force.z(), 0);
  }
  EXPECT_NEAR(squares / area, 1, 0.1);
  // By a line of independent phases, cosines with a variance of 1/2: 5.5 sigma are 5.5/sqrt(2*64) = 0.49.
  EXPECT_LT(std::abs(product) / (2 * area), 0.49);
  EXPECT_LT(std::abs(other) / area, 0.49);
  const double angular_area = 4e-4 * area;
  EXPECT_NEAR(angular / angular_area, 1, 0.1);
  EXPECT_EQ(still(model, 100, 2)[7].specific_force, still(model, 100, 2)[7].specific_force);
}

// The bias of an accelerometer shifts by k a^2/2, in values and increments; without vibration it does not.
TEST(VibrationRectification, OnAShaker) {
  ImuModel model;
  model.accelerometer.vibration_rectification = Vector3(1e-4, 0, -2e-4).asDiagonal();
  EXPECT_EQ(still(model, 1000)[5].specific_force, Vector3::Zero());
  model.vibration.sines = {{.frequency_hz = 100, .force = {10, 20, 30}}};
  const std::vector<Sample> samples = still(model, 1000);
  Vector3 mean = Vector3::Zero(), sum = Vector3::Zero();
  for (std::size_t k = 1; k <= 1000; ++k) {
    mean += samples[k].specific_force / 1000;
    sum += samples[k].delta_velocity;
  }
  const Vector3 expected(1e-4 * 50, 0, -2e-4 * 450);
  EXPECT_LT((mean - expected).norm(), 1e-10);
  EXPECT_LT((sum - expected).norm(), 1e-10);
}

// Effects that respond to specific force respond to that of the vibration.
TEST(Vibration, IsAnInputOfTheEffects) {
  ImuModel model;
  model.gyro.g_sensitivity = 0.01 * Matrix3::Identity();
  model.accelerometer.scale_factor = {2, 2, 2};
  model.vibration.sines = {{.frequency_hz = 30, .force = {10, 20, 30}}};
  const Sample sample = still(model, 1000)[3];
  const Vector3 force = std::sin(2 * pi * 0.09) * Vector3(10, 20, 30);
  EXPECT_LT((sample.specific_force - 2 * force).norm(), 1e-9);
  EXPECT_LT((sample.rate - 0.01 * force).norm(), 1e-10);
}

}  // namespace
}  // namespace imud
