// The internal samples of an Imu: what they leave as it is, and what a filter and a decimation make of noise.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <vector>

#include "core/imu.hpp"
#include "core/units.hpp"
#include "tests/core/allan.hpp"
#include "tests/core/drive.hpp"
#include "tests/support/frequency_response.hpp"

namespace imud {
namespace {

using namespace std::chrono_literals;

ImuModel with_internal(ImuModel model, double rate_hz, int internal_samples) {
  model.rate_hz = rate_hz;
  model.internal_samples = internal_samples;
  return model;
}

ImuModel turning() {
  ImuModel model;
  model.r_SB_B = {0.5, -0.3, 0.8};
  return model;
}

// A sensor of 20 Hz on truths of 200 Hz.
std::vector<Sample> coning(const ImuModel& model) {
  return drive(model, coning_truth, instants(200, 3s), instants(20, 3s));
}

TEST(InternalRate, LeavesTheSamplesOfACleanModel) {
  int compared = 0;
  for (const DeltaAngle angle : {DeltaAngle::rotation_vector, DeltaAngle::integral})
    for (const DeltaVelocity velocity : {DeltaVelocity::integral, DeltaVelocity::memo, DeltaVelocity::end_frame})
      for (const int m : {2, 4, 7}) {
        ImuModel model = turning();
        model.delta_angle = angle;
        model.delta_velocity = velocity;
        const std::vector<Sample> expected = coning(with_internal(model, 20, 1)),
                                  samples = coning(with_internal(model, 20, m));
        ASSERT_EQ(samples.size(), expected.size());
        EXPECT_TRUE(samples[0].delta_angle.isZero(0.0) && samples[0].delta_velocity.isZero(0.0));
        // Integrals by pieces depend on where these end, but not if they do at truths, as at m = 2.
        const bool splits = m != 2;
        const double angle_error = splits && angle == DeltaAngle::integral ? 1e-6 : 1e-12;
        const double velocity_error = !splits || velocity == DeltaVelocity::end_frame ? 1e-12
                                      : velocity == DeltaVelocity::memo               ? 1e-3
                                                                                      : 1e-6;
        for (std::size_t k = 0; k < samples.size(); ++k, ++compared) {
          ASSERT_EQ(samples[k].rate, expected[k].rate);
          ASSERT_EQ(samples[k].specific_force, expected[k].specific_force);
          ASSERT_EQ(samples[k].counter, k);
          ASSERT_LT((samples[k].delta_angle - expected[k].delta_angle).norm(), angle_error) << m;
          ASSERT_LT((samples[k].delta_velocity - expected[k].delta_velocity).norm(), velocity_error) << m;
        }
      }
  EXPECT_EQ(compared, 2 * 3 * 3 * 61);
}

// While the simulator stands still the internal samples go on: the noise of the increments is that of a moving one.
// 600 numbers of three axes know it to 2 %.
TEST(InternalRate, GoesOnWhileTheSimulatorStandsStill) {
  ImuModel model;
  model.gyro.white_density = Vector3::Constant(0.01);
  Timeline timeline;
  Imu imu(with_internal(model, 100, 4), 1, stream_id("imu"));
  Truth truth;
  truth.specific_force_B = {0, 0, -9.80665};
  truth.has_specific_force = true;
  double moving = 0, held = 0;
  for (int k = 0; k < 1200; ++k) {
    const bool stands_still = k >= 600;
    if (!stands_still) truth.time = TruthTime{} + k * 10ms;
    if (!stands_still) timeline.push(truth);
    const Sample sample = imu.sample(timeline, truth.time, DeviceTime{std::int64_t{k} * 10'000'000});
    ASSERT_EQ(sample.counter, static_cast<std::uint64_t>(k));
    if (stands_still) {
      ASSERT_NEAR(sample.delta_velocity.z(), -0.0980665, 1e-9);
    }
    (stands_still ? held : moving) += sample.delta_angle.squaredNorm();
  }
  EXPECT_NEAR(std::sqrt(moving / 1797), 0.01 * std::sqrt(0.01), 0.06 * 0.001);
  EXPECT_NEAR(std::sqrt(held / 1800), 0.01 * std::sqrt(0.01), 0.06 * 0.001);
}

TriadErrors every_term(double sigma) {
  TriadErrors errors;
  errors.white_density = Vector3::Constant(sigma);
  errors.bias_instability = Vector3::Constant(sigma);
  errors.random_walk_density = Vector3::Constant(sigma);
  errors.ramp = Vector3::Constant(sigma);
  errors.filter.cut_off_hz = {5, 0, 20};
  errors.lsb = 0.1 * sigma;
  errors.carry = true;
  errors.increment_lsb = 0.01 * sigma;
  return errors;
}

// Where the truth is integrated before the sample is due, its internal samples are taken then.
TEST(InternalRate, IsTheSameWithAndWithoutAdvance) {
  ImuModel model = turning();
  model.gyro = every_term(1e-3);
  model.accelerometer = every_term(1e-2);
  model = with_internal(model, 20, 8);
  const std::vector<Sample> with = coning(model);
  Timeline timeline;
  for (const TruthTime t : instants(200, 3s)) timeline.push(coning_truth(t));
  Imu imu(model, 1, stream_id("imu"));
  for (std::size_t k = 0; k < with.size(); ++k) {
    const TruthTime t = TruthTime{} + static_cast<std::int64_t>(k) * 50ms;
    const Sample without = imu.sample(timeline, t, DeviceTime{t.ns});
    ASSERT_EQ(without.rate, with[k].rate) << k;
    ASSERT_EQ(without.specific_force, with[k].specific_force) << k;
    // The sums of the same pieces, in another order.
    ASSERT_LT((without.delta_angle - with[k].delta_angle).norm(), 1.01e-5) << k;
    ASSERT_LT((without.delta_velocity - with[k].delta_velocity).norm(), 1.01e-4) << k;
  }
}

TEST(InternalRate, SeekGivesTheNoiseOfTheSequence) {
  ImuModel model;
  model.gyro = every_term(1e-3);
  model.gyro.filter = {};
  model.gyro.carry = false;
  model.gyro.increment_lsb = 0;
  model = with_internal(model, 20, 8);
  Timeline timeline;
  timeline.push(Truth{});
  Imu sequence(model, 1, 1), sought(model, 1, 1);
  sought.seek(37);
  for (std::int64_t k = 0; k < 60; ++k) {
    const TruthTime t = TruthTime{} + k * 50ms;
    const Sample one = sequence.sample(timeline, t, DeviceTime{t.ns});
    if (k < 37) continue;
    const Sample other = sought.sample(timeline, t, DeviceTime{t.ns});
    EXPECT_EQ(one.counter, other.counter);
    EXPECT_EQ(one.rate, other.rate);
    EXPECT_LT((one.delta_angle - other.delta_angle).norm(), k == 37 ? 1.0 : 1e-18);  // the first has none
  }
}

// Limits act on internal samples: a vibration beyond the range leaves the increments short, and sets the status.
TEST(InternalRate, KeepsTheSaturationOfEachInternalSample) {
  ImuModel model;
  model.gyro.max = 0.8;
  const auto vibration = [](TruthTime t) {
    Truth truth;
    truth.time = t;
    truth.omega_BN_B = {std::sin(2 * M_PI * 20 * seconds(t - TruthTime{})), 0, 0};  // 0 at each sample of 20 Hz
    return truth;
  };
  for (const int m : {1, 10}) {
    const std::vector<Sample> samples =
        drive(with_internal(model, 20, m), vibration, instants(200, 1s), instants(20, 1s));
    EXPECT_EQ(samples[5].status, m == 1 ? 0 : status::gyro_saturated_x);
  }
}

// The rates, times the period, and the increments of a vehicle at rest, axis after axis.
struct AtRest {
  std::vector<double> rates[3], increments[3];

  AtRest(const ImuModel& model, std::size_t count) {
    Timeline::Limits limits;
    limits.extrapolate = 240h;
    Timeline timeline(limits);
    timeline.push(Truth{});
    Imu imu(model, 7, stream_id("imu1"));
    const Grid grid(model.rate_hz);
    for (std::uint64_t k = 0; k <= count; ++k) {
      const Nanoseconds offset = grid.offset(k);
      const Sample sample = imu.sample(timeline, TruthTime{} + offset, DeviceTime{} + offset);
      for (int i = 0; i < 3 && k > 0; ++i) {
        rates[i].push_back(sample.rate[i] / model.rate_hz);
        increments[i].push_back(sample.delta_angle[i]);
      }
    }
  }
};

AllanVariance allan_variance(const std::vector<double> (&axes)[3], std::size_t m, double rate_hz) {
  AllanVariance variance;
  for (const std::vector<double>& axis : axes) variance.add(axis, m, 1 / rate_hz);
  return variance;
}

constexpr double aliasing_false_alarm = 1e-6;  // of each of some 14 comparisons
constexpr double unit = units::degree / 60;    // deg/sqrt(h)

// Compares the random walk N, deg/sqrt(h), at an averaging time, s.
void compare(const AllanVariance& variance, double N, double tau) {
  const double expected = N * N * unit * unit / tau;
  EXPECT_GT(variance.degrees, 2000);
  EXPECT_TRUE(variance.fits(expected, aliasing_false_alarm))
      << std::sqrt(tau * variance.value()) / unit << " for " << N << " deg/sqrt(h)";
  EXPECT_FALSE(variance.fits(1.44 * expected, aliasing_false_alarm));  // a fault of 20 % would be found
}

// The angle random walk of the increments does not depend on the internal rate.
TEST(InternalRate, LeavesTheDensityOfTheIncrements) {
  for (const int m : {1, 20}) {
    ImuModel model;
    model.gyro.white_density = Vector3::Constant(0.15 * unit);
    const AtRest rest(with_internal(model, 100, m), 10'000);
    compare(allan_variance(rest.increments, 1, 100), 0.15, 0.01);
  }
}

// A STIM300 of 0.15 deg/sqrt(h) with its filter of 262 Hz: the noise of instantaneous rates aliases when they are
// sent less often than they are sampled, that of the increments does not. The stated figures are those of an analogue
// filter; where it is sampled at 2 kHz, it passes less, because its gain is 0 at 1 kHz.
TEST(InternalRate, AliasesTheNoiseOfADecimatedRate) {
  struct Case {
    double rate_hz;
    int internal_samples;
    double aliased;  // deg/sqrt(h), the root of N^2 times the sum of |H|^2 over the multiples of the rate
  };
  for (const Case& c : {Case{1000, 2, 0.150},
                        {500, 4, 0.155},
                        {250, 8, 0.221},
                        {125, 16, 0.315},  // at 2 kHz
                        {1000, 10, 0.151},
                        {500, 20, 0.161},
                        {250, 40, 0.226},
                        {125, 80, 0.323}}) {  // at 10 kHz
    ImuModel model;
    model.gyro.white_density = Vector3::Constant(0.15 * unit);
    model.gyro.filter.cut_off_hz = Vector3::Constant(262);
    double sum = 0;
    for (int k = 1 - c.internal_samples / 2; k < c.internal_samples / 2; ++k)  // its gain at the end is 0
      sum += std::norm(
          frequency_response(model.gyro.filter, 0, c.internal_samples * c.rate_hz, std::abs(k) * c.rate_hz));
    const double aliased = 0.15 * std::sqrt(sum);
    EXPECT_NEAR(aliased, c.aliased, 0.0006);
    constexpr double tau = 0.08;  // long enough for the density at frequency 0
    const auto m = static_cast<std::size_t>(std::lround(tau * c.rate_hz));
    const AtRest rest(with_internal(model, c.rate_hz, c.internal_samples), 1400 * m);
    compare(allan_variance(rest.rates, m, c.rate_hz), aliased, tau);
    compare(allan_variance(rest.increments, m, c.rate_hz), 0.15, tau);
  }
}

}  // namespace
}  // namespace imud
