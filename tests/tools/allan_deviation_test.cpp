#include "tools/allan/allan_deviation.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <span>

namespace imud {
namespace {

// The data of NIST SP1065, section 12.4, and the published deviations; the Hadamard deviations that overlap, and
// those of the longer set: as printed there, in six or seven digits.
const std::vector<double> nine = {892, 809, 823, 798, 671, 644, 883, 903, 677};

std::vector<double> nist_rates(std::size_t count = 1000) {
  std::vector<double> rates;
  for (std::int64_t n = 1234567890; rates.size() < count; n = 16807 * n % 2147483647)
    rates.push_back(static_cast<double>(n) / 2147483647.0);
  return rates;
}

constexpr double six_digits = 5.1e-7;

double deviation_of(AllanKind kind, std::span<const double> phase, std::size_t factor) {
  return allan_deviations(kind, phase, {&factor, 1}).front();
}

struct Published {
  AllanKind kind;
  std::vector<double> deviations;
};

void expect_published(const std::vector<double>& rates, const std::vector<std::size_t>& factors,
                      const std::vector<Published>& all) {
  ASSERT_EQ(all.size(), std::size(allan_kinds));
  const auto phase = phase_of(rates);
  ASSERT_EQ(phase.size(), rates.size() + 1);
  for (const auto& [kind, deviations] : all) {
    ASSERT_EQ(deviations.size(), factors.size());
    for (std::size_t i = 0; i < factors.size(); ++i)
      EXPECT_NEAR(deviation_of(kind, phase, factors[i]) / deviations[i], 1, six_digits)
          << name_of(kind) << ' ' << factors[i];
  }
}

TEST(AllanDeviation, NinePointsOfNist) {
  expect_published(nine, {1, 2},
                   {{AllanKind::allan, {91.22945, 115.8082}},
                    {AllanKind::overlapping, {91.22945, 85.95287}},
                    {AllanKind::modified, {91.22945, 74.78849}},
                    {AllanKind::hadamard, {70.80607, 116.7980}},
                    {AllanKind::overlapping_hadamard, {70.80607, 85.61487}},
                    {AllanKind::total, {91.22945, 93.90379}}});
}

TEST(AllanDeviation, ThousandPointsOfNist) {
  expect_published(nist_rates(), {1, 10, 100},
                   {{AllanKind::allan, {2.922319e-1, 9.965736e-2, 3.897804e-2}},
                    {AllanKind::overlapping, {2.922319e-1, 9.159953e-2, 3.241343e-2}},
                    {AllanKind::modified, {2.922319e-1, 6.172376e-2, 2.170921e-2}},
                    {AllanKind::hadamard, {2.943883e-1, 1.052754e-1, 3.910861e-2}},
                    {AllanKind::overlapping_hadamard, {2.943883e-1, 9.581083e-2, 3.237638e-2}},
                    {AllanKind::total, {2.922319e-1, 9.134743e-2, 3.406530e-2}}});
}

// The definitions, written down once more without regard to time and digits.
double by_definition(AllanKind kind, std::span<const double> x, std::size_t m) {
  const auto n = static_cast<std::ptrdiff_t>(x.size());
  const auto f = static_cast<std::ptrdiff_t>(m);
  const auto at = [&](std::ptrdiff_t i) -> long double {
    if (i < 0) return 2.0L * x.front() - x[static_cast<std::size_t>(-i)];
    if (i >= n) return 2.0L * x.back() - x[static_cast<std::size_t>(2 * (n - 1) - i)];
    return x[static_cast<std::size_t>(i)];
  };
  const bool is_strided = kind == AllanKind::allan || kind == AllanKind::hadamard;
  const bool is_hadamard = kind == AllanKind::hadamard || kind == AllanKind::overlapping_hadamard;
  const bool is_total = kind == AllanKind::total;
  const std::ptrdiff_t begin = is_total ? 1 - f : 0;
  const std::ptrdiff_t span = is_hadamard || kind == AllanKind::modified ? 3 * f : 2 * f;
  const std::ptrdiff_t end = is_total ? n - 1 - f : n - span + (kind == AllanKind::modified ? 1 : 0);
  long double sum = 0;
  std::ptrdiff_t count = 0;
  for (std::ptrdiff_t i = begin; i < end; i += is_strided ? f : 1, ++count) {
    long double d = 0;
    if (is_hadamard)
      d = at(i + 3 * f) - 3 * at(i + 2 * f) + 3 * at(i + f) - at(i);
    else if (kind != AllanKind::modified)
      d = at(i + 2 * f) - 2 * at(i + f) + at(i);
    else
      for (std::ptrdiff_t j = i; j < i + f; ++j)
        d += (at(j + 2 * f) - 2 * at(j + f) + at(j)) / static_cast<long double>(f);
    sum += d * d;
  }
  EXPECT_EQ(count, static_cast<std::ptrdiff_t>(difference_count(kind, x.size(), m)));
  return static_cast<double>(std::sqrt(sum / static_cast<long double>((is_hadamard ? 6 : 2) * count)) /
                             static_cast<long double>(m));
}

TEST(AllanDeviation, EveryFactorOfShortDataIsByTheDefinition) {
  const auto all = nist_rates();
  std::size_t compared = 0;
  for (const std::size_t size : {2U, 3U, 4U, 5U, 6U, 7U, 31U, 64U}) {
    const auto x = phase_of(std::vector(all.data(), all.data() + size));
    for (const AllanKind kind : allan_kinds)
      for (std::size_t m = 1; m <= largest_factor(kind, x.size()); ++m, ++compared)
        EXPECT_NEAR(deviation_of(kind, x, m) / by_definition(kind, x, m), 1, 1e-12) << name_of(kind) << ' ' << m;
  }
  EXPECT_GT(compared, 250U);
}

TEST(AllanDeviation, TheSumOfPiecesIsByTheDefinition) {
  const auto x = phase_of(nist_rates(40'000));  // more than two pieces of 2^14 points
  for (const AllanKind kind : allan_kinds)
    for (const std::size_t m : {1U, 7U, 1000U})
      EXPECT_NEAR(deviation_of(kind, x, m) / by_definition(kind, x, m), 1, 1e-11) << name_of(kind) << ' ' << m;
}

TEST(AllanDeviation, TooFewSamplesHaveNone) {
  EXPECT_EQ(phase_of({}).size(), 0U);
  for (const AllanKind kind : allan_kinds) {
    for (const std::size_t points : {0U, 1U, 2U}) EXPECT_EQ(largest_factor(kind, points), 0U) << name_of(kind);
    EXPECT_EQ(deviation_of(kind, std::vector<double>{0, 1, 3, 2}, 4), 0) << name_of(kind);
    EXPECT_EQ(difference_count(kind, 100, 0), 0U);
  }
}

// An hour at 2 kHz of 9.8 m/s^2 with noise of 1e-6 m/s^2. The differences of a plain sum, which ends at 7e7, have
// lost the noise's digits.
TEST(AllanDeviation, TheSumKeepsItsDigitsForAnHour) {
  constexpr std::size_t count = 7'200'000;
  std::vector<double> rates(count);
  std::vector<double> small(count);
  for (std::size_t i = 0; i < count; ++i) {
    // A multiple of 2^-40, of which 9.8 and the sum need no further digit: the reference is exact.
    small[i] = std::ldexp(static_cast<double>((i * 7919) % 2001) - 1000, -40);
    rates[i] = 9.75 + small[i];
  }
  const auto phase = phase_of(rates);
  ASSERT_EQ(phase.size(), count + 1);
  std::vector<double> exact(count + 1);
  for (std::size_t i = 0; i < count; ++i) exact[i + 1] = exact[i] + small[i];
  for (const std::size_t m : {1U, 64U, 4096U, 262144U})
    for (const AllanKind kind : {AllanKind::overlapping, AllanKind::modified, AllanKind::overlapping_hadamard})
      EXPECT_NEAR(deviation_of(kind, phase, m) / deviation_of(kind, exact, m), 1, 1e-6) << name_of(kind) << m;
}

TEST(AllanDeviation, AveragingFactorsAreOctavesOrSoManyPerDecade) {
  using Factors = std::vector<std::size_t>;
  EXPECT_EQ(averaging_factors(0, 0), Factors{});
  EXPECT_EQ(averaging_factors(40, 0), (Factors{1, 2, 4, 8, 16, 32}));
  EXPECT_EQ(averaging_factors(100, 1), (Factors{1, 10, 100}));
  EXPECT_EQ(averaging_factors(32, 4), (Factors{1, 2, 3, 6, 10, 18, 32}));
  EXPECT_EQ(averaging_factors(1000, 100).size(), 180U);
}

}  // namespace
}  // namespace imud
