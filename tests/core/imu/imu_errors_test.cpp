// Rounding, carry and saturation, and their effect on the increments.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "core/imu.hpp"
#include "tests/core/drive.hpp"

namespace imud {
namespace {

using namespace std::chrono_literals;

// Returns the accelerometers' output, one sample per force, 10 ms apart.
std::vector<Sample> samples_of(const TriadErrors& errors, const std::vector<Vector3>& forces) {
  ImuModel model;
  model.accelerometer = errors;
  model.gyro = errors;  // and the gyros, of the same numbers in rad/s
  Timeline timeline;
  Imu imu(model, 1, 1);
  std::vector<Sample> samples;
  for (std::size_t k = 0; k < forces.size(); ++k) {
    Truth truth;
    truth.time = TruthTime{} + static_cast<std::int64_t>(k) * 10ms;
    truth.omega_BN_B = truth.specific_force_B = forces[k];
    truth.has_specific_force = true;
    timeline.push(truth);
    samples.push_back(imu.sample(timeline, truth.time, {}));
  }
  return samples;
}

double rounded(Rounding rounding, double lsb, double value) {
  TriadErrors errors;
  errors.lsb = lsb;
  errors.rounding = rounding;
  errors.max = 1e300;
  const Sample sample = samples_of(errors, {Vector3(value, 0.0, -value)})[0];
  EXPECT_EQ(sample.specific_force.z(), -sample.specific_force.x()) << value;
  EXPECT_EQ(sample.rate, sample.specific_force);
  return sample.specific_force.x();
}

TEST(Rounding, TowardZero) {
  EXPECT_EQ(rounded(Rounding::toward_zero, 10.0, 0.1), 0.0);
  EXPECT_EQ(rounded(Rounding::toward_zero, 10.0, 10.1), 10.0);
  EXPECT_EQ(rounded(Rounding::toward_zero, 10.0, 19.999), 10.0);
  EXPECT_EQ(rounded(Rounding::toward_zero, 10.0, -19.999), -10.0);
  EXPECT_EQ(rounded(Rounding::toward_zero, 0.25, 0.75), 0.75);
}

TEST(Rounding, ToNearestHalfAwayFromZero) {
  EXPECT_EQ(rounded(Rounding::nearest, 10.0, 4.999), 0.0);
  EXPECT_EQ(rounded(Rounding::nearest, 10.0, 5.0), 10.0);
  EXPECT_EQ(rounded(Rounding::nearest, 10.0, 15.0), 20.0);
  EXPECT_EQ(rounded(Rounding::nearest, 10.0, 25.0), 30.0);
  EXPECT_EQ(rounded(Rounding::nearest, 10.0, -5.0), -10.0);
  EXPECT_EQ(rounded(Rounding::nearest, 10.0, -14.999), -10.0);
  EXPECT_EQ(rounded(Rounding::nearest, 1.0, 0.49999999999999994), 0.0);  // where floor(x + 0.5) fails
}

TEST(Rounding, AwayFromZero) {
  EXPECT_EQ(rounded(Rounding::away_from_zero, 10.0, 0.1), 10.0);
  EXPECT_EQ(rounded(Rounding::away_from_zero, 10.0, 10.0), 10.0);
  EXPECT_EQ(rounded(Rounding::away_from_zero, 10.0, 10.1), 20.0);
  EXPECT_EQ(rounded(Rounding::away_from_zero, 10.0, -10.1), -20.0);
  EXPECT_EQ(rounded(Rounding::away_from_zero, 10.0, 0.0), 0.0);
}

TEST(Rounding, OfNumbersTooLargeToRound) {
  for (const Rounding rounding : {Rounding::toward_zero, Rounding::nearest, Rounding::away_from_zero}) {
    EXPECT_EQ(rounded(rounding, 1.0, 0x1p53), 0x1p53);
    EXPECT_EQ(rounded(rounding, 1e-3, 1e8), 1e8);
    EXPECT_NEAR(rounded(rounding, 1e-300, 1e8) / 1e8, 1.0, 1e-12) << "count overflows";
  }
}

// A force that a coarse LSB rounds strongly, over many samples; all axes differ.
std::vector<Vector3> varied_forces() {
  std::vector<Vector3> forces;
  for (int k = 0; k < 3'000; ++k)
    forces.emplace_back(0.0537, -1.0 + 0.3 * std::sin(0.01 * k), 0.004 * std::cos(0.37 * k));
  return forces;
}

// Eq. 19 takes the remainder from this sample; its increments lose it times the step.
TEST(Rounding, IncrementsLoseTheRemainder) {
  for (const Rounding rounding : {Rounding::toward_zero, Rounding::nearest, Rounding::away_from_zero})
    for (const bool carry : {false, true}) {
      TriadErrors errors;
      const std::vector<Sample> exact = samples_of(errors, varied_forces());
      errors.lsb = 0.01;
      errors.rounding = rounding;
      errors.carry = carry;
      const std::vector<Sample> coarse = samples_of(errors, varied_forces());
      for (std::size_t k = 1; k < exact.size(); ++k) {
        const Vector3 lost = exact[k].specific_force - coarse[k].specific_force;
        ASSERT_LE(lost.cwiseAbs().maxCoeff(), carry ? 0.02 : 0.01 + 1e-12);
        ASSERT_LT((coarse[k].delta_velocity - (exact[k].delta_velocity - 0.01 * lost)).norm(), 1e-15);
        const Vector3 lost_rate = exact[k].rate - coarse[k].rate;
        ASSERT_LT((coarse[k].delta_angle - (exact[k].delta_angle - 0.01 * lost_rate)).norm(), 1e-15);
        // The output lies on the grid.
        const Vector3 counts = coarse[k].specific_force / 0.01;
        for (int i = 0; i < 3; ++i) ASSERT_NEAR(counts[i], std::round(counts[i]), 1e-9);
      }
    }
}

// With carry nothing is lost for good: the sums of samples and of increments stay within one LSB of the truth for
// ever. Without it, toward zero, up to one LSB is lost in every sample.
TEST(Carry, KeepsTheSumsBounded) {
  constexpr double lsb = 0.01, dt = 0.01;
  for (const Rounding rounding : {Rounding::toward_zero, Rounding::nearest, Rounding::away_from_zero}) {
    TriadErrors errors;
    const std::vector<Sample> exact = samples_of(errors, varied_forces());
    errors.lsb = lsb;
    errors.rounding = rounding;
    errors.carry = true;
    const std::vector<Sample> carried = samples_of(errors, varied_forces());
    const double bound = rounding == Rounding::nearest ? 0.5 * lsb : lsb;
    Vector3 sum = Vector3::Zero(), increments = Vector3::Zero();
    for (std::size_t k = 0; k < exact.size(); ++k) {
      sum += carried[k].specific_force - exact[k].specific_force;
      increments += carried[k].delta_velocity - exact[k].delta_velocity;
      ASSERT_LT(sum.cwiseAbs().maxCoeff(), bound + 1e-9) << k;
      ASSERT_LT(increments.cwiseAbs().maxCoeff(), 2.0 * (bound + 1e-9) * dt) << k;  // the first sample has none
    }
    errors.carry = false;
    const std::vector<Sample> lost = samples_of(errors, varied_forces());
    double drift = 0;
    for (std::size_t k = 0; k < exact.size(); ++k) drift += (lost[k].delta_velocity - exact[k].delta_velocity).x();
    EXPECT_GT(std::abs(drift), 100.0 * lsb * dt) << "0.0537 on a grid of 0.01";
  }
}

// --- Saturation
// -----------------------------------------------------------------------------------------------------

TEST(Saturation, LimitsEachAxisAndOverwritesItsIncrement) {
  TriadErrors errors;
  errors.max = 2.0;
  const std::vector<Vector3> forces = {{1.0, -3.0, 2.0}, {2.5, 1.5, -2.0000001}, {2.5, -2.5, 0.5}, {0.0, 0.0, 0.0}};
  const std::vector<Sample> samples = samples_of(errors, forces);
  const std::vector<Vector3> expected = {{1.0, -2.0, 2.0}, {2.0, 1.5, -2.0}, {2.0, -2.0, 0.5}, {0.0, 0.0, 0.0}};
  const std::vector<std::uint32_t> bits = {0b010'010, 0b101'101, 0b011'011, 0};
  const std::vector<Sample> unlimited = samples_of({}, forces);
  for (std::size_t k = 0; k < forces.size(); ++k) {
    EXPECT_EQ(samples[k].rate, expected[k]) << k;
    EXPECT_EQ(samples[k].specific_force, expected[k]) << k;
    EXPECT_EQ(samples[k].status, bits[k]) << k;  // exactly at the limit is not beyond it
    for (int i = 0; i < 3; ++i) {
      const bool saturated = (bits[k] >> static_cast<unsigned>(i) & 1U) != 0;
      const double dt = k > 0 ? 0.01 : 0.0;
      EXPECT_EQ(samples[k].delta_angle[i], saturated ? expected[k][i] * dt : unlimited[k].delta_angle[i]) << k;
      EXPECT_EQ(samples[k].delta_velocity[i], saturated ? expected[k][i] * dt : unlimited[k].delta_velocity[i]) << k;
    }
  }
}

TEST(Saturation, ComesAfterRoundingAndMayLieOffItsGrid) {
  TriadErrors errors;
  errors.lsb = 0.3;
  errors.rounding = Rounding::away_from_zero;
  errors.max = 1.0;
  const Sample sample = samples_of(errors, {{0.95, 0.85, -7.0}})[0];
  EXPECT_EQ(sample.rate.x(), 1.0) << "0.95 is rounded to 1.2, then limited";
  EXPECT_NEAR(sample.rate.y(), 0.9, 1e-15);
  EXPECT_EQ(sample.rate.z(), -1.0);
  EXPECT_EQ(sample.status & 7U, 0b101U);
}

TEST(Saturation, ComesAfterScaleBiasAndNoise) {
  TriadErrors errors;
  errors.max = 2.0;
  errors.scale_factor = {2.0, 0.5, 1.0};
  errors.bias = {0.0, 0.0, 1.5};
  const Sample sample = samples_of(errors, {{1.5, 3.0, 1.0}})[0];
  EXPECT_EQ(sample.rate, Vector3(2.0, 1.5, 2.0));
  EXPECT_EQ(sample.status & 7U, 0b101U);
}

// Each axis and direction has its own limit; the axes do not affect one another.
TEST(Saturation, HasLimitsOfEachAxisAndDirection) {
  TriadErrors errors;
  errors.max = 3.0;
  errors.limits = {.lower = {-1.0, -4.0, 0.0}, .upper = {3.0, 2.0, 1.0}};
  const auto at = [&](const Vector3& rate) { return samples_of(errors, {rate})[0]; };
  EXPECT_EQ(at({3.5, 2.5, 1.5}).rate, Vector3(3.0, 2.0, 1.0));
  EXPECT_EQ(at({3.5, 2.5, 1.5}).status & 7U, 0b111U);
  EXPECT_EQ(at({-1.5, -4.5, -0.5}).rate, Vector3(-1.0, -4.0, 0.0));
  EXPECT_EQ(at({-1.5, -4.5, -0.5}).status & 7U, 0b111U);
  EXPECT_EQ(at({2.5, -3.5, 0.5}).rate, Vector3(2.5, -3.5, 0.5));
  EXPECT_EQ(at({2.5, -3.5, 0.5}).status & 7U, 0U);
  EXPECT_EQ(at({-1.5, 0.5, 0.5}).rate, Vector3(-1.0, 0.5, 0.5));
  EXPECT_EQ(at({-1.5, 0.5, 0.5}).status & 7U, 0b001U);
  // The increment is that of the limited value.
  EXPECT_EQ(samples_of(errors, {{0, 0, 0.5}, {0, 0, 1.5}})[1].delta_angle.z(), 1.0 * 0.01);
}

// No finite truth leads to NaN. Where it occurs none the less, the sample says that it is no measurement.
TEST(Saturation, NanIsWithinNoRange) {
  Vector3 value(std::numeric_limits<double>::quiet_NaN(), 0.5, 0), increment(0.01, 0.005, 0);
  const AxisLimits range{Vector3::Constant(-1), Vector3::Constant(1)};
  EXPECT_TRUE(limit_axis(range, 0, 0.01, value, increment));
  EXPECT_TRUE(std::isnan(value[0]) && std::isnan(increment[0]));
  EXPECT_FALSE(limit_axis(range, 1, 0.01, value, increment));
  EXPECT_EQ(value[1], 0.5);
  EXPECT_EQ(increment[1], 0.005);
}

// The scale factor acts on the truth only: bias and noise have the configured values.
TEST(ScaleFactor, ActsOnTheTruthAlone) {
  TriadErrors errors;
  errors.scale_factor = {2.0, 0.5, -1.0};
  errors.bias = {0.25, 0.25, 0.25};
  const std::vector<Sample> samples = samples_of(errors, {{1.0, 1.0, 1.0}, {1.0, 1.0, 1.0}});
  EXPECT_EQ(samples[1].specific_force, Vector3(2.25, 0.75, -0.75));
  EXPECT_LT((samples[1].delta_velocity - 0.01 * Vector3(2.25, 0.75, -0.75)).norm(), 1e-3)
      << "the body turns a little";
}

TEST(Sample, CarriesTimeCounterAndTemperature) {
  ImuModel model;
  model.temperature_c = 31.5;
  Timeline timeline;
  timeline.push(Truth{});
  Imu imu(model, 1, 1);
  for (std::uint64_t k = 0; k < 3; ++k) {
    const Sample sample = imu.sample(timeline, {static_cast<std::int64_t>(k)}, {1000 + static_cast<std::int64_t>(k)});
    EXPECT_EQ(sample.time.ns, 1000 + static_cast<std::int64_t>(k));
    EXPECT_EQ(sample.counter, k);
    EXPECT_EQ(sample.temperature_c, 31.5);
  }
}

}  // namespace
}  // namespace imud
