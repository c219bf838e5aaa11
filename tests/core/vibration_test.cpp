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

// The gyros' shift is a matrix of the accelerations' mean squares, and follows the square of the envelope.
TEST(VibrationRectification, OfGyrosFollowsTheEnvelope) {
  ImuModel model;
  model.gyro.vibration_rectification << 0, 1e-5, 0, 0, 0, 0, 0, 0, 2e-5;
  model.vibration.sines = {{.frequency_hz = 100, .force = {10, 20, 30}}};
  model.vibration.envelope = {.of = std::nullopt, .at = {0, 1}, .factor = {1, 3}};
  const std::vector<Sample> samples = still(model, 1000);
  for (const std::size_t k : {0U, 250U, 1000U}) {
    const double factor = 1 + 2e-3 * static_cast<double>(k);
    EXPECT_LT((samples[k].rate - factor * factor * Vector3(1e-5 * 200, 0, 2e-5 * 450)).norm(), 1e-12) << k;
  }
}

// A rotor of 6000 rpm: harmonics of 100 Hz, whose integrals are exact; a throttle that scales them.
TEST(Vibration, FollowsARotorAndItsThrottle) {
  ImuModel model;
  model.vibration.harmonics = {{.order = 1, .force = {3, 0, 0}, .rate = {0, 0.1, 0}},
                               {.order = 2.5, .force = {0, 2, 0}, .phase = 0.4}};
  model.vibration.envelope = {.of = VehicleState::throttle, .at = {0, 1}, .factor = {0, 10}};
  const auto samples = drive(
      model,
      [](TruthTime t) {
        Truth truth;
        truth.time = t;
        truth.has_specific_force = true;
        truth.vehicle.set(VehicleState::rotor_speed, 200 * pi);
        truth.vehicle.set(VehicleState::throttle, 0.3);
        return truth;
      },
      instants(50, 1s), instants(700, 1s), 1);
  ASSERT_EQ(samples.size(), 701U);
  const auto integral = [](double omega, double phase, double t1, double t2) {
    return (std::cos(omega * t1 + phase) - std::cos(omega * t2 + phase)) / omega;
  };
  double t1 = 0;
  for (std::size_t k = 1; k < samples.size(); ++k) {
    const double t2 = seconds(samples[k].time - DeviceTime{}), omega = 200 * pi;
    const Vector3 force(9 * std::sin(omega * t2), 6 * std::sin(2.5 * omega * t2 + 0.4), 0);
    EXPECT_LT((samples[k].specific_force - force).norm(), 1e-6) << k;  // the times are rounded to 1 ns
    EXPECT_NEAR(samples[k].rate.y(), 0.3 * std::sin(omega * t2), 1e-6) << k;
    const Vector3 velocity(9 * integral(omega, 0, t1, t2), 6 * integral(2.5 * omega, 0.4, t1, t2), 0);
    EXPECT_LT((samples[k].delta_velocity - velocity).norm(), 1e-8) << k;
    EXPECT_NEAR(samples[k].delta_angle.y(), 0.3 * integral(omega, 0, t1, t2), 1e-9) << k;
    t1 = t2;
  }
}

// Without the states, the factor is the one of 0, and a rotor stands still.
TEST(Vibration, StandsStillWithoutTheStatesOfTheTruth) {
  ImuModel model;
  model.vibration.harmonics = {{.order = 1, .force = {3, 0, 0}, .phase = pi / 2}};
  model.vibration.envelope = {.of = VehicleState::airspeed, .at = {0, 50}, .factor = {0.5, 10}};
  const std::vector<Sample> samples = still(model, 100);
  for (std::size_t k = 1; k < samples.size(); ++k) {
    EXPECT_NEAR(samples[k].specific_force.x(), 1.5, 1e-12);
    EXPECT_NEAR(samples[k].delta_velocity.x(), 0.015, 1e-12);
  }
}

// A vehicle at rest has no states either: before the first truth, and after a truth that had them.
TEST(Vibration, AtRestIsTheOneWithoutStates) {
  ImuModel model;
  model.vibration.harmonics = {{.order = 1, .rate = {3, 0, 0}, .phase = pi / 2}};
  model.vibration.envelope = {.of = VehicleState::airspeed, .at = {0, 50}, .factor = {0.5, 10}};
  model.gyro.vibration_rectification = Matrix3::Identity();
  model.vibration.sines = {{.frequency_hz = 100, .force = {0, 0, 2}}};  // 100 Hz: 0 at every sample
  Imu imu(model, 1, 1);
  const auto expect_at_rest = [&] {
    for (int k = 0; k < 3; ++k) {
      const Sample sample = imu.sample_at_rest(10ms * k, {});
      EXPECT_NEAR(std::abs(sample.rate.x()), 1.5, 1e-12) << k;
      EXPECT_NEAR(sample.rate.z(), 0.5 * 0.5 * 2, 1e-12) << k;
      EXPECT_NEAR(std::abs(sample.delta_angle.x()), k > 0 ? 0.015 : 0, 1e-12) << k;
    }
  };
  expect_at_rest();
  Timeline timeline;
  for (const Nanoseconds at : {0ms, 10ms, 20ms}) {
    Truth truth;
    truth.time = TruthTime{} + at;
    truth.vehicle.set(VehicleState::airspeed, 50);
    truth.vehicle.set(VehicleState::rotor_speed, 30);
    timeline.push(truth);
    EXPECT_NEAR(imu.sample(timeline, truth.time, {}).rate.z(), 10 * 10 * 2, 1e-9);
  }
  imu.begin_run();
  EXPECT_NEAR(imu.sample_at_rest(30ms, {}).rate.z(), 0.5 * 0.5 * 2, 1e-12);
}

// A factor that follows the truth's time follows the time since power on at rest, as the phases do.
TEST(Vibration, AtRestFollowsTheTimeSincePowerOn) {
  ImuModel model;
  model.vibration.sines = {{.frequency_hz = 25, .force = {4, 0, 0}}};
  model.vibration.envelope = {.of = std::nullopt, .at = {0, 1}, .factor = {0, 1}};
  Imu imu(model, 1, 1);
  for (int k = 0; k < 100; ++k) {
    const double factor = 0.01 * k, force = 4 * std::sin(2 * pi * 0.25 * k);
    EXPECT_NEAR(imu.sample_at_rest(10ms * k, {}).specific_force.x(), factor * force, 1e-9) << k;
  }
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
