#include "tools/allan/allan_confidence.hpp"

#include <gtest/gtest.h>

#include <array>

#include "tests/tools/synthetic_noise.hpp"
#include "tools/allan/allan_curve.hpp"

namespace imud {
namespace {

// allantools (https://github.com/aewallin/allantools, revision 599dc9e), edf_greenhall(alpha, d, m, N); every branch
// of Greenhall and Riley's four cases.
TEST(AllanConfidence, DegreesOfFreedomAreThoseOfAllantools) {
  const struct {
    AllanKind kind;
    int alpha;
    std::size_t points, factor;
    double degrees;
  } known[] = {
      {AllanKind::allan, 2, 1001, 10, 51.180156657963444},
      {AllanKind::allan, 1, 1001, 250, 1.9057664942788077},
      {AllanKind::allan, 0, 1001, 10, 66.98757687537804},
      {AllanKind::allan, -1, 1001, 100, 8.091568345518882},
      {AllanKind::allan, -2, 1001, 1, 762.2904904738508},
      {AllanKind::overlapping, 2, 1001, 100, 440.20651801029163},
      {AllanKind::overlapping, 1, 1001, 10, 247.3068334724611},
      {AllanKind::overlapping, 1, 100001, 25000, 64.92034806741235},
      {AllanKind::overlapping, 0, 1001, 10, 135.0714051003793},
      {AllanKind::overlapping, 0, 1001, 100, 12.814933422103863},
      {AllanKind::overlapping, 0, 100001, 25000, 3.997657848552399},
      {AllanKind::overlapping, -1, 1001, 250, 3.0031504654824532},
      {AllanKind::overlapping, -2, 100001, 10, 9246.539944591792},
      {AllanKind::modified, 2, 1001, 10, 123.94023271983103},
      {AllanKind::modified, 1, 100001, 25000, 2.0629875713565524},
      {AllanKind::modified, 0, 1001, 100, 7.416542005159031},
      {AllanKind::modified, -2, 1001, 250, 1.2882304164024572},
      {AllanKind::hadamard, 0, 1001, 10, 51.138492514443115},
      {AllanKind::hadamard, -4, 1001, 100, 6.28968504647595},
      {AllanKind::overlapping_hadamard, 2, 1001, 100, 334.44337818431785},
      {AllanKind::overlapping_hadamard, 1, 1001, 250, 16.862585674721192},
      {AllanKind::overlapping_hadamard, -1, 1001, 100, 7.71191640889709},
      {AllanKind::overlapping_hadamard, -4, 1001, 250, 1.2861029918854399},
  };
  for (const auto& [kind, alpha, points, factor, degrees] : known)
    EXPECT_NEAR(degrees_of_freedom(kind, alpha, points, factor) / degrees, 1, 1e-7)
        << name_of(kind) << ' ' << alpha << ' ' << points << ' ' << factor;
}

// Two second differences of white phase, one averaging time apart, have the correlation -2/3: 4/(2 + 2 * 4/9).
TEST(AllanConfidence, FewDifferencesOfWhitePhase) {
  EXPECT_NEAR(degrees_of_freedom(AllanKind::allan, 2, 101, 33), 4 / (2 + 8.0 / 9), 1e-12);
}

// NIST SP1065, table 7: b T/tau - c.
TEST(AllanConfidence, DegreesOfFreedomOfTheTotalDeviation) {
  EXPECT_NEAR(degrees_of_freedom(AllanKind::total, 0, 1001, 100), 15.0, 1e-12);
  EXPECT_NEAR(degrees_of_freedom(AllanKind::total, -1, 1001, 100), 11.7 - 0.22, 1e-12);
  EXPECT_NEAR(degrees_of_freedom(AllanKind::total, -2, 1001, 500), 1.86 - 0.36, 1e-12);
  EXPECT_LT(degrees_of_freedom(AllanKind::total, 2, 1001, 100),
            degrees_of_freedom(AllanKind::overlapping, 2, 1001, 100));
}

// 10 degrees of freedom, one standard deviation: SciPy 1.10, chi2.ppf.
TEST(AllanConfidence, BoundsAreThoseOfChiSquare) {
  const auto bounds = deviation_bounds(2, 10, 0.6826894921370859);
  EXPECT_NEAR(bounds.low, 2 * 0.8354972202956162, 1e-12);
  EXPECT_NEAR(bounds.high, 2 * 1.3267900875295446, 1e-12);
}

std::size_t identified(AllanKind kind, const AllanTerms& terms, int alpha, std::size_t factor) {
  std::size_t right = 0;
  for (std::uint64_t seed = 0; seed < 50; ++seed) {
    const auto phase = phase_of(SyntheticNoise(seed).rates(terms, 20000, 1));
    if (identify_noise(kind, phase, factor) == alpha) ++right;
  }
  return right;
}

TEST(AllanConfidence, TheNoiseTypeIsIdentified) {
  for (const std::size_t factor : {1U, 20U}) {
    EXPECT_EQ(identified(AllanKind::overlapping, {.Q = 1}, 2, factor), 50U) << factor;
    EXPECT_EQ(identified(AllanKind::overlapping, {.N = 1}, 0, factor), 50U) << factor;
    EXPECT_EQ(identified(AllanKind::overlapping, {.K = 1}, -2, factor), 50U) << factor;
    EXPECT_EQ(identified(AllanKind::overlapping_hadamard, {.K = 1}, -2, factor), 50U) << factor;
  }
  // The averages of flicker have a correlation next to the limit of those of a random walk.
  EXPECT_GE(identified(AllanKind::overlapping, {.B = 1}, -1, 20), 25U);
  // A ramp is no noise.
  EXPECT_EQ(identified(AllanKind::overlapping, {.N = 1, .R = 1}, 0, 1), 50U);
}

TEST(AllanConfidence, NoNoiseTypeWithoutNoise) {
  const auto phase = phase_of(std::vector<double>(1000, 9.8));
  EXPECT_EQ(identify_noise(AllanKind::overlapping, phase, 1), std::nullopt);
  EXPECT_EQ(identify_noise(AllanKind::overlapping, phase_of(SyntheticNoise(1).rates({.N = 1}, 29, 1)), 1),
            std::nullopt);
}

// At a tenth of the record the true deviation is between the bounds in 68.27 % of the recordings: of 400, 273 +- 4.5
// standard deviations (false alarm: 1 in 150,000 for each).
TEST(AllanConfidence, TheBoundsHoldTheTrueDeviationAsOftenAsStated) {
  for (const AllanTerms& terms : {AllanTerms{.N = 1}, AllanTerms{.K = 1}, AllanTerms{.Q = 1}}) {
    for (const AllanKind kind : allan_kinds) {
      int held = 0;
      for (std::uint64_t seed = 0; seed < 400; ++seed) {
        const auto phase = phase_of(SyntheticNoise(seed).rates(terms, 1000, 1));
        const int alpha = terms.Q > 0 ? 2 : terms.N > 0 ? 0 : -2;
        const auto bounds = deviation_bounds(allan_deviations(kind, phase, std::array<std::size_t, 1>{100}).front(),
                                             degrees_of_freedom(kind, alpha, phase.size(), 100), 0.6827);
        const double expected = expected_deviation(kind, terms, {100, 100, 1000});
        if (bounds.low <= expected && expected <= bounds.high) ++held;
      }
      // The squares of two points are a part of the total deviation of quantisation: its distribution has more weight
      // at the centre, and at the ends, than chi-square.
      const int least = 273 - 42, most = kind == AllanKind::total && terms.Q > 0 ? 400 : 273 + 42;
      EXPECT_TRUE(least <= held && held <= most)
          << held << ' ' << name_of(kind) << " Q " << terms.Q << " N " << terms.N << " K " << terms.K;
    }
  }
}

}  // namespace
}  // namespace imud
