#include "tools/allan/allan_fit.hpp"

#include <gtest/gtest.h>

#include <limits>

#include "tests/tools/synthetic_noise.hpp"

namespace imud {
namespace {

constexpr double infinite = std::numeric_limits<double>::infinity();
constexpr double fit_rate_hz = 100;

AllanFit fit_of(const AllanTerms& terms, std::uint64_t seed, std::size_t count,
                AllanKind kind = AllanKind::overlapping, unsigned per_decade = 0) {
  const auto rates = SyntheticNoise(seed).rates(terms, count, 1 / fit_rate_hz);
  return fit_allan_terms(allan_curve(kind, rates, fit_rate_hz, per_decade, 0.68), 0, infinite);
}

const AllanFit::Term& term_of(const AllanFit& fit, char letter) {
  for (std::size_t t = 0; t < allan_term_count; ++t)
    if (allan_term_list[t].letter == letter) return fit.terms[t];
  throw std::invalid_argument("no such term");
}

struct Case {
  char letter;
  AllanTerms terms;
  double largest_error;  // relative standard error
};

// Each term beside white noise, where a recording of ten thousand seconds shows it.
const Case cases[] = {
    {'N', {.N = 1}, 0.002},          {'Q', {.N = 1, .Q = 0.1}, 0.005},  {'B', {.N = 0.3, .B = 1}, 0.02},
    {'K', {.N = 1, .K = 0.3}, 0.05}, {'R', {.N = 1, .R = 0.003}, 0.01},
};

// Each estimate is within 4.5 of its standard errors, and 1 % for what the synthetic flicker lacks at the shortest
// times. (False alarm: 7e-6 each.) An error of 20 % in the data is outside of that.
TEST(AllanFit, EachTermIsFoundAndATwentyPercentErrorIsNoticed) {
  for (const Case& wanted : cases) {
    for (const double error : {1.0, 1.2, 0.8}) {
      AllanTerms terms = wanted.terms;
      for (const AllanTerm& term : allan_term_list)
        if (term.letter == wanted.letter) terms.*term.value *= error;
      const auto found = term_of(fit_of(terms, 1, 1'000'000), wanted.letter);
      ASSERT_TRUE(found.value.has_value()) << wanted.letter;
      double truth = 0;
      for (const AllanTerm& term : allan_term_list)
        if (term.letter == wanted.letter) truth = wanted.terms.*term.value;
      EXPECT_LT(found.error, wanted.largest_error * *found.value) << wanted.letter;
      EXPECT_EQ(std::abs(*found.value - truth) < 4.5 * found.error + 0.01 * truth, error == 1.0)
          << wanted.letter << ' ' << *found.value << " +- " << found.error;
    }
  }
}

TEST(AllanFit, EveryKindFindsWhiteNoiseAndARandomWalk) {
  for (const AllanKind kind : allan_kinds) {
    const auto fit = fit_of({.N = 1, .K = 0.3}, 2, 300'000, kind);
    for (const auto& [letter, truth] : {std::pair('N', 1.0), std::pair('K', 0.3)}) {
      const auto& found = term_of(fit, letter);
      ASSERT_TRUE(found.value.has_value()) << name_of(kind) << letter;
      EXPECT_NEAR(*found.value, truth, 4.5 * found.error) << name_of(kind) << letter;
      EXPECT_LT(found.error, 0.15 * truth) << name_of(kind) << letter;
    }
  }
}

// A term that is absent is found with a probability of 1 in 1000. In 4 * 60 decisions more than 5 are 1 in 400,000.
TEST(AllanFit, ATermThatIsAbsentIsNotSeen) {
  int alarms = 0;
  for (std::uint64_t seed = 0; seed < 60; ++seed) {
    const auto fit = fit_of({.N = 1}, seed, 20'000);
    EXPECT_TRUE(term_of(fit, 'N').value.has_value());
    for (const char letter : {'Q', 'B', 'K', 'R'}) {
      if (term_of(fit, letter).value) ++alarms;
      EXPECT_GT(term_of(fit, letter).least_seen, 0) << letter;
      EXPECT_LT(term_of(fit, letter).least_seen, infinite) << letter;
    }
    EXPECT_EQ(fit.misfit, 0) << seed;
  }
  EXPECT_LE(alarms, 5);
}

// The values scatter as their standard errors say: in 100 recordings the mean square of the distance in standard
// errors is 1 +- 0.14, for each kind.
TEST(AllanFit, TheStandardErrorsAreThoseOfTheScatter) {
  for (const AllanKind kind : allan_kinds) {
    double of_N = 0, of_K = 0;
    for (std::uint64_t seed = 100; seed < 200; ++seed) {
      const auto fit = fit_of({.N = 1, .K = 3}, seed, 20'000, kind);
      const auto &N = term_of(fit, 'N'), &K = term_of(fit, 'K');
      ASSERT_TRUE(N.value && K.value) << name_of(kind) << seed;
      of_N += std::pow((*N.value - 1) / N.error, 2);
      of_K += std::pow((*K.value - 3) / K.error, 2);
    }
    EXPECT_NEAR(of_N / 100, 1, 0.55) << name_of(kind);
    EXPECT_NEAR(of_K / 100, 1, 0.55) << name_of(kind);
  }
}

// White noise behind a low-pass filter: the shortest times are lower than any sum of terms.
TEST(AllanFit, WhatTheModelLacksIsAMisfit) {
  auto rates = SyntheticNoise(3).rates({.N = 1}, 300'000, 1 / fit_rate_hz);
  double filtered = 0;
  for (double& rate : rates) rate = filtered += 0.1 * (rate - filtered);
  const auto curve = allan_curve(AllanKind::overlapping, rates, fit_rate_hz, 0, 0.68);
  EXPECT_GT(fit_allan_terms(curve, 0, infinite).misfit, 0.1);
  const auto from = fit_allan_terms(curve, 2, infinite);
  EXPECT_LT(from.misfit, 0.05);
  EXPECT_NEAR(term_of(from, 'N').value.value(), 1, 0.05);
}

TEST(AllanFit, NoNoiseHasNoTerms) {
  const std::vector<double> rates(1000, 9.8);
  const auto curve = allan_curve(AllanKind::overlapping, rates, fit_rate_hz, 0, 0.68);
  ASSERT_GT(curve.points.size(), 5U);
  for (const auto& fit : {fit_allan_terms(curve, 0, infinite), fit_allan_terms(AllanCurve{}, 0, infinite)})
    for (const auto& term : fit.terms) EXPECT_FALSE(term.value.has_value());
}

}  // namespace
}  // namespace imud
