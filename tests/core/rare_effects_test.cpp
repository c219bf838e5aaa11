// The effects that hardly any sensor has, against closed forms.
#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "core/triad.hpp"
#include "tests/core/allan.hpp"

namespace imud {
namespace {

const Vector3 zero = Vector3::Zero();

TriadStep step_of(const Normals& normals, std::uint64_t k, double period_s, const Vector3& value = zero,
                  const Vector3& force = zero, const Surroundings& surroundings = TriadStep::ordinary) {
  static thread_local Vector3 kept_force, delta_velocity;
  kept_force = force;
  delta_velocity = period_s * force;
  return {.normals = normals,
          .k = k,
          .dt = period_s,
          .since_power_on = static_cast<double>(k) * period_s,
          .specific_force = kept_force,
          .delta_velocity = delta_velocity,
          .surroundings = surroundings,
          .value = lanes(value),
          .increment = lanes(period_s * value),
          .begins_run = k == 0};
}

TEST(DeadZone, HasNoResponseAboutZero) {
  TriadErrors errors;
  errors.dead_zone = {0.1, 0.2, 0};
  Triad triad(errors, Quantity::rate, 0.01);
  const Normals normals(1, 1);
  int compared = 0;
  for (const double rate : {-0.5, -0.1, -0.05, 0.0, 0.09, 0.15, 0.2, 1.0}) {
    TriadStep step = step_of(normals, 0, 0.01, Vector3::Constant(rate));
    triad.apply(step);
    const auto expected = [rate](double z) { return std::abs(rate) <= z ? 0.0 : rate - std::copysign(z, rate); };
    const Vector3 all(expected(0.1), expected(0.2), rate);
    EXPECT_LT((vector_of(step.value) - all).norm(), 1e-15) << rate;
    EXPECT_LT((vector_of(step.increment) - 0.01 * all).norm(), 1e-16) << rate;
    ++compared;
  }
  EXPECT_EQ(compared, 8);
}

// The rate of the temperature counts at once. Hysteresis: 2 w after a reversal, the bias is on the other curve.
TEST(ThermalDrift, FollowsTheRateAndTheHistoryOfTheTemperature) {
  TriadErrors errors;
  errors.temperature_rate_bias = {1e-3, 0, -2e-3};
  errors.temperature_hysteresis = {0, 5e-4, 0};
  errors.temperature_hysteresis_c = 4;
  Triad triad(errors, Quantity::rate, 1);
  const Normals normals(1, 1);
  double temperature_c = 20;
  std::uint64_t k = 0;
  // Warms by 0.5 K a sample, or cools, and returns the bias at the end.
  const auto change = [&](int samples, double rate) {
    Vector3 bias;
    for (int i = 0; i < samples; ++i) {
      temperature_c += k > 0 ? rate : 0;
      const Surroundings surroundings = {.temperature_c = temperature_c, .temperature_rate = rate};
      TriadStep step = step_of(normals, k++, 1, zero, zero, surroundings);
      triad.apply(step);
      EXPECT_EQ(vector_of(step.increment), vector_of(step.value));
      bias = vector_of(step.value);
    }
    return bias;
  };
  const auto expect = [](const Vector3& bias, double rate, double play) {
    EXPECT_LT((bias - Vector3(1e-3 * rate, 5e-4 * play, -2e-3 * rate)).norm(), 1e-15) << rate << " " << play;
  };
  expect(change(1, 0), 0, 0);
  expect(change(4, 0.5), 0.5, 0.5);  // 2 K of w = 4 K
  expect(change(40, 0.5), 0.5, 1);   // on the curve of warming
  expect(change(8, -0.5), -0.5, 0);  // 4 K back: in the middle
  expect(change(4, -0.5), -0.5, -0.5);
  expect(change(40, -0.5), -0.5, -1);  // on the curve of cooling: the gap is 2 h
  expect(change(10, 0), 0, -1);        // the history stays
  expect(change(4, 0.5), 0.5, -0.5);   // a small loop within
  expect(change(4, -0.5), -0.5, -1);
}

TEST(CrossSensitivity, RespondsToProducts) {
  TriadErrors errors;
  errors.cross_sensitivity << 1, 2, 3, 4, 5, 6, 7, 8, 9;
  Triad triad(errors, Quantity::specific_force, 0.5);
  const Normals normals(1, 1);
  TriadStep step = step_of(normals, 0, 0.5, zero, Vector3(2, 3, 5));
  triad.apply(step);
  // The products are 15, 10 and 6.
  EXPECT_LT((vector_of(step.value) - Vector3(15 + 20 + 18, 60 + 50 + 36, 105 + 80 + 54)).norm(), 1e-12);
  EXPECT_LT((vector_of(step.increment) - 0.5 * vector_of(step.value)).norm(), 1e-12);
}

TriadErrors popcorn(double level, double time_s) {
  TriadErrors errors;
  errors.popcorn_noise = {level, 2 * level, 0};
  errors.popcorn_time = Vector3::Constant(time_s);
  return errors;
}

// The times between two changes: mean and standard deviation are tau. With n of them, the relative standard error of
// the mean is 1/sqrt(n), and the one of the mean square 2.24/sqrt(n): 5.5 of them are a false alarm below 4e-8 each.
TEST(PopcornNoise, ChangesAtExponentiallyDistributedTimes) {
  constexpr double rate_hz = 100, time_s = 0.5;
  Triad triad(popcorn(1, time_s), Quantity::rate, 1 / rate_hz);
  const Normals normals(3, 5);
  double last = 0, since = 0, sum = 0, square = 0;
  int changes = -1, positive = 0;
  constexpr std::uint64_t count = 2'000'000;
  for (std::uint64_t k = 0; k < count; ++k) {
    TriadStep step = step_of(normals, k, 1 / rate_hz);
    triad.apply(step);
    ASSERT_EQ(std::abs(step.value[0]), 1);
    ASSERT_EQ(std::abs(step.value[1]), 2);
    ASSERT_EQ(step.value[2], 0);
    positive += step.value[0] > 0 ? 1 : 0;
    // The mean over a step with one change says when it was.
    const double mean = step.increment[0] * rate_hz;
    if (k > 0 && step.value[0] != last) {
      const double at = static_cast<double>(k - 1) / rate_hz + 0.5 * (1 + last * mean) / rate_hz;
      if (changes >= 0) {
        sum += at - since;
        square += (at - since) * (at - since);
      }
      since = at;
      ++changes;
    }
    last = step.value[0];
  }
  ASSERT_GT(changes, 35'000);
  // Two changes within a sample are not seen: the times between those that are seen are longer by T/tau at most.
  const double seen = 1 / rate_hz / time_s;
  const double error = 5.5 / std::sqrt(changes);
  EXPECT_NEAR(sum / changes / time_s, 1, error + seen);
  EXPECT_NEAR(square / changes / (2 * time_s * time_s), 1, 2.24 * error + 2 * seen);
  // Correlated over tau/2: count T/tau independent halves.
  EXPECT_NEAR(static_cast<double>(positive) / count, 0.5, 5.5 * 0.5 / std::sqrt(count / rate_hz / time_s));
}

// The Allan variance at averaging times of some 10 to 100 changes, where the averages are nearly normal.
TEST(PopcornNoise, HasTheAllanVarianceOfItsAutocovariance) {
  constexpr double period = 0.01, level = 3, time_s = 0.2;
  Triad triad(popcorn(level, time_s), Quantity::rate, period);
  const Normals normals(8, 9);
  std::vector<double> increments;
  for (std::uint64_t k = 0; k < 4'000'000; ++k) {
    TriadStep step = step_of(normals, k, period);
    triad.apply(step);
    increments.push_back(step.increment[0]);
  }
  int compared = 0;
  for (const std::size_t m : {200U, 600U, 2000U}) {
    AllanVariance variance;
    variance.add(increments, m, period);
    const double x = static_cast<double>(m) * period / (0.5 * time_s);
    const double expected = level * level * 2 / x * (1 - (3 - 4 * std::exp(-x) + std::exp(-2 * x)) / (2 * x));
    EXPECT_TRUE(variance.fits(expected, 1e-7)) << m << " " << variance.value() / expected;
    EXPECT_FALSE(variance.fits(1.44 * expected, 1e-7)) << m;
    ++compared;
  }
  EXPECT_EQ(compared, 3);
}

// It is a process in continuous time: sensors of different rates have the same integral over the same time.
TEST(PopcornNoise, HasTheSameIntegralAtAnyRate) {
  const auto integral = [](double rate_hz) {
    Triad triad(popcorn(1, 0.3), Quantity::rate, 1 / rate_hz);
    const Normals normals(4, 4);
    Vector3 sum = zero;
    for (std::uint64_t k = 0; k <= static_cast<std::uint64_t>(20 * rate_hz); ++k) {
      TriadStep step = step_of(normals, k, 1 / rate_hz);
      triad.apply(step);
      if (k > 0) sum += vector_of(step.increment);
    }
    return sum;
  };
  const Vector3 expected = integral(1000);
  EXPECT_GT(expected.head<2>().norm(), 0.1);
  for (const double rate_hz : {10.0, 125.0, 400.0}) EXPECT_LT((integral(rate_hz) - expected).norm(), 1e-9) << rate_hz;
}

// The sum of the increments is one reading, and the Allan variance 3 Q^2/tau^2. Neighbouring pairs of averages share
// a reading, which widens the band by some 3 %.
TEST(QuantizationNoise, IsWhiteInTheAngle) {
  constexpr double period = 0.01, Q = 1e-5;
  TriadErrors errors;
  errors.quantization_noise = {Q, 0, 2 * Q};
  Triad triad(errors, Quantity::rate, period);
  const Normals normals(8, 9);
  std::vector<double> increments;
  double sum = 0, square = 0;
  constexpr std::uint64_t count = 1'000'000;
  for (std::uint64_t k = 0; k < count; ++k) {
    TriadStep step = step_of(normals, k, period);
    triad.apply(step);
    EXPECT_NEAR(step.value[0] * period, step.increment[0], 1e-18);
    increments.push_back(step.increment[0]);
    sum += step.increment[0];
    square += sum * sum / count;
  }
  // Each sum is a reading less the first.
  EXPECT_NEAR(square / (Q * Q), 1, 8) << "it does not grow";
  int compared = 0;
  for (const std::size_t m : {1U, 10U, 500U}) {
    AllanVariance variance;
    variance.add(increments, m, period);
    const double tau = static_cast<double>(m) * period;
    EXPECT_TRUE(variance.fits(3 * Q * Q / (tau * tau), 1e-7)) << m;
    EXPECT_FALSE(variance.fits(1.44 * 3 * Q * Q / (tau * tau), 1e-7)) << m;
    ++compared;
  }
  EXPECT_EQ(compared, 3);
}

TEST(RareEffects, SeekAndAnotherSensorGoOnAsTheSequence) {
  TriadErrors errors = popcorn(1, 0.05);
  errors.quantization_noise = {1e-4, 2e-4, 0};
  const Normals normals(3, 4);
  int compared = 0;
  for (const std::uint64_t from : {0U, 1U, 2U, 16U, 17U, 1000U}) {
    Triad sequence(errors, Quantity::rate, 0.01), sought(errors, Quantity::rate, 0.01),
        next(errors, Quantity::rate, 0.01);
    sought.seek(normals, from);
    for (std::uint64_t k = 0; k < from + 100; ++k) {
      if (k == from && k > 0) next.continue_from(sequence, normals, k);
      TriadStep one = step_of(normals, k, 0.01);
      sequence.apply(one);
      if (k < from) continue;
      TriadStep other = step_of(normals, k, 0.01), third = step_of(normals, k, 0.01);
      sought.apply(other);
      next.apply(third);
      ASSERT_EQ(vector_of(one.value), vector_of(other.value)) << from << " " << k;
      ASSERT_EQ(vector_of(one.increment), vector_of(other.increment)) << from << " " << k;
      ASSERT_EQ(vector_of(one.value), vector_of(third.value)) << from << " " << k;
      ++compared;
    }
  }
  EXPECT_EQ(compared, 600);
}

TEST(FirFilter, HasTheResponseAndTheDelayOfItsTaps) {
  constexpr double rate_hz = 2000;
  const std::vector<double> taps = {0.1, 0.4, 0.3, -0.05, 0.25};
  TriadErrors errors;
  errors.fir_taps = std::make_shared<const std::vector<double>>(taps);
  const Normals normals(1, 1);
  int compared = 0;
  for (const int hz : {0, 1, 150, 700, 1000}) {
    Triad triad(errors, Quantity::rate, 1 / rate_hz);
    std::complex<double> expected = 0;
    for (std::size_t i = 0; i < taps.size(); ++i)
      expected += taps[i] * std::polar(1.0, -2 * M_PI * hz * static_cast<double>(i) / rate_hz);
    for (std::uint64_t k = 0; k < 100; ++k) {
      const std::complex<double> input = std::polar(1.0, 2 * M_PI * hz * static_cast<double>(k) / rate_hz + 0.3);
      TriadStep step = step_of(normals, k, 1 / rate_hz, Vector3(input.real(), 0, 1));
      triad.apply(step);
      if (k >= taps.size()) {
        EXPECT_NEAR(step.value[0], (expected * input).real(), 1e-12) << hz << " " << k;
      }
      EXPECT_NEAR(step.value[2], 1, 1e-12) << "settled on the first value";
      EXPECT_NEAR(step.increment[0], input.real() / rate_hz, 1e-15) << "increments are not filtered";
      ++compared;
    }
  }
  EXPECT_EQ(compared, 500);
  EXPECT_NEAR(group_delay_s(taps, rate_hz), (0.4 + 0.6 - 0.15 + 1.0) / rate_hz, 1e-15);
}

// The gain at the cut-off is 1/k; the peak is 1/(k sqrt(1 - k^2/4)), near the cut-off times sqrt(1 - k^2/2).
TEST(Bandwidth, PeaksByItsDamping) {
  constexpr double rate_hz = 20'000, cut_off_hz = 200;
  const auto gain = [&](double damping, double hz) {
    TriadErrors errors;
    errors.filter.cut_off_hz = {cut_off_hz, 0, 0};
    errors.filter.damping = damping;
    Triad triad(errors, Quantity::rate, 1 / rate_hz);
    const Normals normals(1, 1);
    std::complex<double> ratio = 0;
    const int period = static_cast<int>(std::lround(rate_hz / hz)), settling = 200 * period;
    for (int k = 0; k < settling + period; ++k) {
      const double phase = 2 * M_PI * k / period;
      TriadStep step = step_of(normals, static_cast<std::uint64_t>(k), 1 / rate_hz, Vector3(std::sin(phase), 0, 0));
      triad.apply(step);
      if (k >= settling) ratio += 2.0 / period * std::polar(1.0, -phase) * step.value[0];
    }
    return std::abs(ratio);
  };
  for (const double damping : {0.2, 0.5, 1.0, 2.0}) {
    EXPECT_NEAR(gain(damping, cut_off_hz), 1 / damping, 1e-9) << damping;
    const double peak_hz = cut_off_hz * std::sqrt(std::max(0.0, 1 - 0.5 * damping * damping));
    if (damping < 1.0) {
      EXPECT_NEAR(gain(damping, peak_hz) * damping * std::sqrt(1 - 0.25 * damping * damping), 1, 0.01);
    }
    SensorFilter filter;
    filter.cut_off_hz = {cut_off_hz, 0, 0};
    filter.damping = damping;
    EXPECT_NEAR(group_delay_s(filter, 0, rate_hz) * 2 * M_PI * cut_off_hz, damping, 1e-3 * damping);
  }
  EXPECT_NEAR(gain(0, cut_off_hz), std::sqrt(0.5), 1e-9) << "0 is the Butterworth filter";
}

// A sine of the truth's own force, of 50 Hz with an average of 2 s: the mean square is A^2/2, less what the mean
// follows and with a ripple of some (period/average)/(4 pi).
TEST(VibrationRectification, AveragesTheVibrationOfTheTruth) {
  constexpr double rate_hz = 2000, A = 30;
  TriadErrors errors;
  errors.vibration_rectification << 0, 0, 2e-5, 0, 1e-5, 0, 0, 0, 0;
  errors.vibration_average = 2;
  Triad triad(errors, Quantity::rate, 1 / rate_hz);
  const Normals normals(1, 1);
  for (std::uint64_t k = 0; k < 40'000; ++k) {
    const double sin = std::sin(2 * M_PI * 50 * static_cast<double>(k) / rate_hz);
    TriadStep step = step_of(normals, k, 1 / rate_hz, zero, Vector3(0, 2 * A * sin, 9.8 + A * sin));
    triad.apply(step);
    const double share = 1 - std::exp(-static_cast<double>(k) / rate_hz / 2);
    if (k % 1000 != 999) continue;
    EXPECT_NEAR(step.value[0], share * 2e-5 * A * A / 2, 0.01 * 2e-5 * A * A / 2) << k;
    EXPECT_NEAR(step.value[1], share * 1e-5 * 4 * A * A / 2, 0.01 * 1e-5 * 4 * A * A / 2) << k;
    EXPECT_EQ(step.value[2], 0);
  }
}

// Where a rare effect is on, all effects act out of line, as they do in line. One tap of 1 is such an effect.
TEST(RareEffects, LeaveTheOthersAsTheyAre) {
  TriadErrors errors;
  errors.misalignment << 1, 1e-3, 0, 0, 1, 2e-3, -1e-3, 0, 1;
  errors.white_density = Vector3::Constant(1e-3);
  errors.bias_instability = Vector3::Constant(1e-4);
  errors.g_sensitivity = 1e-3 * Matrix3::Identity();
  errors.correlated_sigma = Vector3::Constant(1e-3);
  errors.filter.cut_off_hz = Vector3::Constant(20);
  errors.lsb = 1e-6;
  errors.max = 1.5;
  TriadErrors with_tap = errors;
  with_tap.fir_taps = std::make_shared<const std::vector<double>>(1, 1.0);
  Triad plain(errors, Quantity::rate, 0.01), other(with_tap, Quantity::rate, 0.01);
  const Normals normals(6, 7);
  std::uint32_t saturated = 0;
  for (std::uint64_t k = 0; k < 1000; ++k) {
    const Vector3 value = Vector3::Constant(2 * std::sin(0.01 * static_cast<double>(k))), force(1, 2, 3);
    TriadStep one = step_of(normals, k, 0.01, value, force);
    plain.apply(one);
    TriadStep two = step_of(normals, k, 0.01, value, force);
    other.apply(two);
    ASSERT_EQ(vector_of(one.value), vector_of(two.value)) << k;
    ASSERT_EQ(vector_of(one.increment), vector_of(two.increment)) << k;
    ASSERT_EQ(one.saturated, two.saturated) << k;
    saturated |= one.saturated;
  }
  EXPECT_EQ(saturated, 7U);
}

}  // namespace
}  // namespace imud
