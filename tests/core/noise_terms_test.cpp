// The terms of noise of IEEE Std 952 against their Allan variances, at any rate, alone and together.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "core/imu.hpp"
#include "core/triad.hpp"
#include "tests/core/allan.hpp"

namespace imud {
namespace {

constexpr std::size_t samples = 2'000'000;
constexpr double false_alarm = 1e-6;  // of each comparison, of which there are some 40

// Takes sample k of three sensors at rest.
TriadStep take(Triad& triad, const Normals& normals, std::uint64_t k, double rate_hz) {
  static const Vector3 zero = Vector3::Zero();
  TriadStep step = {.normals = normals,
                    .k = k,
                    .dt = 1.0 / rate_hz,
                    .since_power_on = static_cast<double>(k) / rate_hz,
                    .specific_force = zero,
                    .delta_velocity = zero,
                    .value = lanes(zero),
                    .increment = lanes(zero)};
  triad.apply(step);
  return step;
}

// The increments of three sensors at rest, axis after axis.
std::vector<std::vector<double>> increments_of(const TriadErrors& errors, double rate_hz,
                                               std::size_t count = samples) {
  const Normals normals(2026, stream_id("imu1"));
  Triad triad(errors, Quantity::rate, 1.0 / rate_hz);
  std::vector<std::vector<double>> axes(3, std::vector<double>(count));
  for (std::size_t k = 0; k < count; ++k) {
    const TriadStep step = take(triad, normals, k, rate_hz);
    for (std::size_t i = 0; i < 3; ++i) axes[i][k] = step.increment[static_cast<int>(i)];
  }
  return axes;
}

struct Term {
  std::string name;
  TriadErrors errors;
  std::function<double(double tau)> allan_variance;
};

TriadErrors with(const std::function<void(TriadErrors&)>& set) {
  TriadErrors errors;
  set(errors);
  return errors;
}

constexpr double N = 4e-5, B = 3e-6, K = 2e-6, R = 4e-9, sigma = 5e-6, correlation_time = 0.8;

// The Allan variance of an exponentially correlated process of variance 1 (IEEE Std 952-1997, C.1.4).
double correlated_variance(double tau, double time) {
  const double x = tau / time;
  if (x < 1e-3) return x * (2.0 / 3.0 - 0.5 * x);  // of its series, where the difference would cancel
  return 2 / x * (1 - (3 - 4 * std::exp(-x) + std::exp(-2 * x)) / (2 * x));
}
double exponentially_correlated(double tau) { return sigma * sigma * correlated_variance(tau, correlation_time); }
// The Allan variance of the octaves of Flicker for B = 1, of which the first and the last count twice.
double flicker_variance(double from_s, double to_s, double tau) {
  const std::size_t count = Flicker::octaves(from_s, to_s);
  double sum = 0, time = Flicker::first_correlation_time(from_s);
  for (std::size_t i = 0; i < count; ++i, time *= 2)
    sum += (i == 0 || i + 1 == count ? 2 : 1) * std::log(2.0) / M_PI * correlated_variance(tau, time);
  return sum;
}

const std::vector<Term>& terms() {
  static const std::vector<Term> all = {
      {"white noise", with([](TriadErrors& e) { e.white_density = Vector3::Constant(N); }),
       [](double tau) { return N * N / tau; }},
      {"bias instability", with([](TriadErrors& e) {
         e.bias_instability = Vector3::Constant(B);
         e.flicker_from_s = 0.5;
         e.flicker_to_s = 100;
       }),
       [](double tau) { return B * B * flicker_variance(0.5, 100, tau); }},
      {"exponentially correlated", with([](TriadErrors& e) {
         e.correlated_sigma = Vector3::Constant(sigma);
         e.correlation_time = Vector3::Constant(correlation_time);
       }),
       exponentially_correlated},
      {"random walk", with([](TriadErrors& e) { e.random_walk_density = Vector3::Constant(K); }),
       [](double tau) { return K * K * tau / 3; }},
      {"ramp", with([](TriadErrors& e) { e.ramp = Vector3::Constant(R); }),
       [](double tau) { return R * R * tau * tau / 2; }},
  };
  return all;
}

// Compares the Allan variance with `expected` at three averaging times, each with more than 700 pairs of averages.
// `tolerance` is the relative error of the formula.
void compare(const std::string& name, const TriadErrors& errors, const std::function<double(double)>& expected,
             double rate_hz, const std::array<double, 3>& taus, double tolerance = 0) {
  const std::vector<std::vector<double>> axes = increments_of(errors, rate_hz);
  const double period = 1 / rate_hz;
  int compared = 0;
  for (const double tau : taus) {
    AllanVariance variance;
    const auto m = static_cast<std::size_t>(std::lround(tau * rate_hz));
    for (const std::vector<double>& axis : axes) variance.add(axis, m, period);
    ASSERT_GT(variance.degrees, 700);
    const double e = expected(tau);
    EXPECT_TRUE(variance.fits(e, false_alarm) || variance.fits(e * (1 + tolerance), false_alarm) ||
                variance.fits(e * (1 - tolerance), false_alarm))
        << name << " at " << rate_hz << " Hz, " << tau << " s: " << std::sqrt(variance.value()) << " for "
        << std::sqrt(e);
    // A fault of 20 % would be found.
    EXPECT_FALSE(variance.fits(e * 1.44, false_alarm)) << name << " " << tau;
    ++compared;
  }
  EXPECT_EQ(compared, 3);
}

TEST(NoiseTerms, EachAloneHasItsAllanVarianceAtAnyRate) {
  int compared = 0;
  for (const Term& term : terms()) {
    if (term.name == "ramp") continue;  // is not random: see below
    for (const double rate_hz : {100.0, 1000.0}) {
      if (term.name == "bias instability")  // whose variance is up to 2 % smaller between nodes
        compare(term.name, term.errors, term.allan_variance, rate_hz, {0.5, 2.0, 4.0}, 0.02);
      else
        compare(term.name, term.errors, term.allan_variance, rate_hz, {0.1, 1.0, 4.0});
      ++compared;
    }
  }
  EXPECT_EQ(compared, 8);
}

// Where samples are not much closer together than the correlation times, down to an averaging time of one sample: the
// Allan deviation is within 2 % of its closed form.
TEST(NoiseTerms, AreExactAtLowRates) {
  constexpr std::size_t count = 200'000;
  int compared = 0;
  const auto compare_all = [&](const std::string& name, const TriadErrors& errors, double rate_hz, auto&& expected) {
    const std::vector<std::vector<double>> axes = increments_of(errors, rate_hz, count);
    for (const std::size_t m : {1U, 2U, 5U, 50U}) {
      AllanVariance variance;
      for (const std::vector<double>& axis : axes) variance.add(axis, m, 1 / rate_hz);
      const double ratio = variance.value() / expected(static_cast<double>(m) / rate_hz);
      // 5.2 standard errors: a false alarm of 2e-7 for each of 28 comparisons.
      EXPECT_NEAR(ratio, 1, 0.04 + 5.2 * std::sqrt(2 / variance.degrees)) << name << " " << rate_hz << " Hz, " << m;
      ++compared;
    }
  };
  for (const double rate_hz : {1.0, 2.0, 5.0, 10.0, 30.0}) {
    TriadErrors flicker;
    flicker.bias_instability = Vector3::Constant(B);
    flicker.flicker_from_s = std::max(1.0, 6.2001 / rate_hz);  // as the configuration has it
    compare_all("bias instability", flicker, rate_hz, [&](double tau) {
      return B * B * flicker_variance(flicker.flicker_from_s, flicker.flicker_to_s, tau);
    });
  }
  TriadErrors correlated;
  correlated.correlated_sigma = Vector3::Constant(sigma);
  correlated.correlation_time = Vector3::Constant(correlation_time);
  for (const double rate_hz : {1.0, 5.0})
    compare_all("exponentially correlated", correlated, rate_hz, exponentially_correlated);
  EXPECT_EQ(compared, 28);
}

TEST(NoiseTerms, AllTogetherHaveTheSumOfTheirAllanVariances) {
  TriadErrors all;
  for (const Term& term : terms()) {
    all.white_density += term.errors.white_density;
    all.bias_instability += term.errors.bias_instability;
    all.correlated_sigma += term.errors.correlated_sigma;
    all.random_walk_density += term.errors.random_walk_density;
  }
  all.flicker_from_s = 0.5;
  all.flicker_to_s = 100;
  all.correlation_time = Vector3::Constant(correlation_time);
  const auto sum = [](double tau) {
    double variance = 0;
    for (const Term& term : terms())
      if (term.name != "ramp") variance += term.allan_variance(tau);
    return variance;
  };
  for (const double rate_hz : {100.0, 1000.0}) compare("all", all, sum, rate_hz, {0.1, 1.0, 4.0}, 0.01);
}

TEST(NoiseTerms, ARampIsExact) {
  const Term& ramp = terms().back();
  ASSERT_EQ(ramp.name, "ramp");
  for (const double rate_hz : {100.0, 1000.0}) {
    const std::vector<double> axis = increments_of(ramp.errors, rate_hz, 20'000)[2];
    AllanVariance variance;
    variance.add(axis, 1000, 1 / rate_hz);
    EXPECT_NEAR(variance.value() / ramp.allan_variance(1000 / rate_hz), 1, 1e-6);
  }
}

// The sum over octaves of the analytic variances, not the data.
// Not where the time of the truth, or of the sensor's stamps, begins.
TEST(NoiseTerms, ARampBeginsAtPowerOn) {
  ImuModel model;
  model.rate_hz = 100;
  model.gyro.ramp = {1e-3, 0, 0};
  Timeline timeline;
  Imu imu(model, 1, 1);
  constexpr std::int64_t begin = 1'400'000'000'000'000'000, period = 10'000'000;  // ns, as of GPS time
  for (int k = 0; k < 100; ++k) {
    if (k == 50) imu.power_on(1);
    Truth truth;
    truth.time = TruthTime{begin + k * period};
    timeline.push(truth);
    const Sample sample = imu.sample(timeline, truth.time, DeviceTime{begin + k * period});
    EXPECT_NEAR(sample.rate.x(), 1e-3 * 0.01 * (k % 50), 1e-15) << k;
  }
}

TEST(BiasInstability, TheCascadeIsFlatOverItsDecades) {
  const double plateau = 2 * std::log(2.0) / M_PI;
  int compared = 0;
  for (const auto& [from, to] : {std::pair{1.0, 1000.0}, {0.5, 5.0}, {10.0, 20.0}, {0.1, 1e5}})
    for (double tau = from; tau <= to; tau *= 1.1, ++compared)
      EXPECT_NEAR(std::sqrt(flicker_variance(from, to, tau) / plateau), 1, 0.05) << from << " " << tau;
  EXPECT_GT(compared, 200);
}

// Stationary from the first sample: the variance of the first sample, over seeds, is that of all others.
TEST(BiasInstability, IsStationaryFromTheFirstSample) {
  TriadErrors errors;
  errors.bias_instability = Vector3::Ones();
  errors.correlated_sigma = Vector3::Constant(2);
  errors.flicker_from_s = 1;
  errors.flicker_to_s = 40;  // eight octaves, of which two count twice
  const double expected = (8 + 2) * std::log(2.0) / M_PI + 4;
  double sum = 0;
  constexpr int seeds = 5000;
  for (int seed = 0; seed < seeds; ++seed) {
    const Normals normals(static_cast<std::uint64_t>(seed), 1);
    Triad triad(errors, Quantity::rate, 0.01);
    sum += vector_of(take(triad, normals, 0, 100).value).squaredNorm();
  }
  // 4.9 standard errors of sqrt(2/n): 1e-6.
  EXPECT_NEAR(sum / (3 * seeds) / expected, 1, 4.9 * std::sqrt(2.0 / (3 * seeds)));
}

// Each term's sample k after seek(k) is that of the sequence.
TEST(NoiseTerms, SeekGivesTheSameAsTheSequence) {
  for (const Term& term : terms())
    for (const std::uint64_t from : {0U, 1U, 2U, 15U, 16U, 17U, 63U, 1000U, 4097U}) {
      const Normals normals(3, 4);
      Triad sequence(term.errors, Quantity::specific_force, 0.01),
          sought(term.errors, Quantity::specific_force, 0.01);
      sought.seek(normals, from);
      for (std::uint64_t k = 0; k < from + 200; ++k) {
        const TriadStep one = take(sequence, normals, k, 100);
        if (k < from) continue;
        const TriadStep other = take(sought, normals, k, 100);
        ASSERT_EQ(vector_of(one.value), vector_of(other.value)) << term.name << " " << k;
        ASSERT_EQ(vector_of(one.increment), vector_of(other.increment)) << term.name << " " << k;
      }
    }
}

// The value is that at the end of the step, the increment the integral over it: half of the difference of the values.
TEST(NoiseTerms, IncrementsAreTheIntegralsOfTheValues) {
  for (const Term& term : terms()) {
    if (term.name == "white noise") continue;  // has no value between samples
    const Normals normals(3, 4);
    Triad triad(term.errors, Quantity::rate, 0.01);
    const Vector3 zero = Vector3::Zero();
    Vector3 before = zero, sum = zero, trapezoids = zero;
    for (std::uint64_t k = 0; k < 5000; ++k) {
      const TriadStep step = take(triad, normals, k, 100);
      if (k > 0) {
        sum += vector_of(step.increment);
        trapezoids += 0.005 * (before + vector_of(step.value));
      }
      before = vector_of(step.value);
    }
    // A walk's increments contain its course within the steps: 4.9 sigma of K sqrt(T^3/12) each. The driving noise of
    // an exponentially correlated process has K = sigma sqrt(2/Tc).
    const double walk = term.name == "random walk"                ? K
                        : term.name == "exponentially correlated" ? sigma * std::sqrt(2 / correlation_time)
                                                                  : 0;
    const double within = 1.001 * walk * 4.9 * std::sqrt(1e-6 / 12 * 5000) + 1e-12 * sum.norm();
    EXPECT_LT((sum - trapezoids).cwiseAbs().maxCoeff(), within) << term.name;
    EXPECT_GT(sum.norm(), 1e-9) << term.name;
  }
}

}  // namespace
}  // namespace imud
