#include "core/numbers/elementary.hpp"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>

#include "core/numbers/random.hpp"
#include "tests/core/hash.hpp"

namespace imud::elementary {
namespace {

constexpr double ulp_of_1 = std::numeric_limits<double>::epsilon();

// The largest error of `function` against `reference`, in units of ulp(1) * scale(reference).
template <class Function, class Reference, class Scale>
double worst(double from, double to, int n, Function function, Reference reference, Scale scale) {
  double worst = 0.0;
  for (int i = 0; i <= n; ++i) {
    const double x = from + (to - from) * i / n;
    const long double exact = reference(x);
    const auto error = static_cast<double>(std::abs(static_cast<long double>(function(x)) - exact));
    worst = std::max(worst, error / (ulp_of_1 * scale(static_cast<double>(exact))));
  }
  return worst;
}

double absolute(double) { return 1.0; }
double relative(double y) { return std::abs(y); }

long double sinc(double x) { return x == 0.0 ? 1.0L : std::sin(static_cast<long double>(x)) / x; }
long double versine(double x) {
  const long double half = sinc(0.5 * x);
  return 0.5L * half * half;
}
long double cubic(double x) {
  const long double z = static_cast<long double>(x) * x;
  if (x > 0.5) return (1.0L - sinc(x)) / z;
  long double sum = 1.0L;  // 1 - z/(4*5) + z^2/(4*5*6*7) - ...
  for (int k = 12; k >= 1; --k) sum = 1.0L - z / ((2 * k + 2) * (2 * k + 3)) * sum;
  return sum / 6.0L;
}

TEST(Elementary, EvenSeriesWithinTwoUlpOfOne) {
  for (const double to : {0.04, 0.6, 3.2, 50.0}) {  // each branch
    SCOPED_TRACE(to);
    EXPECT_LT(worst(
                  0, to, 100'000, [](double x) { return even_series(x * x).sinc; }, sinc, absolute),
              2.0);
    EXPECT_LT(worst(
                  0, to, 100'000, [](double x) { return even_series(x * x).versine; }, versine, absolute),
              2.0);
    EXPECT_LT(worst(
                  0, to, 100'000, [](double x) { return even_series(x * x).cubic; }, cubic, absolute),
              2.0);
    // x^2 is rounded here, which changes the cosine by up to x/4 ulp of 1.
    const auto cosine = [](double x) { return std::cos(static_cast<long double>(x)); };
    EXPECT_LT(worst(
                  0, to, 100'000, [](double x) { return even_series(x * x).cos; }, cosine, absolute),
              2.0 + to / 4);
  }
}

TEST(Elementary, EvenSeriesAtZeroAndWithoutLimit) {
  const EvenSeries zero = even_series(0.0);
  EXPECT_EQ(zero.sinc, 1.0);
  EXPECT_EQ(zero.cos, 1.0);
  EXPECT_EQ(zero.versine, 0.5);
  EXPECT_EQ(zero.cubic, 1.0 / 6.0);
  for (double z = 9.0; z < 1e30; z *= 7.3) {
    const EvenSeries even = even_series(z);
    EXPECT_LE(std::abs(even.cos), 1.0 + 1e-15);
    EXPECT_LE(std::abs(even.sinc), 1.0 / std::sqrt(z) + 1e-15);
    EXPECT_LE(even.versine, 2.0 / z + 1e-15);
  }
}

TEST(Elementary, AtanWithinThreeUlp) {
  const auto exact = [](double x) { return x == 0.0 ? 1.0L : std::atan(static_cast<long double>(x)) / x; };
  for (const double to : {0.009, 0.012, 0.11, 1.0})
    EXPECT_LT(worst(
                  0, to, 100'000, [](double x) { return atan_over_x(x * x); }, exact, absolute),
              3.0)
        << to;
  EXPECT_EQ(atan_over_x(0.0), 1.0);
}

TEST(Elementary, Atan2IsTheAngleAllRound) {
  for (int i = -720; i <= 720; ++i) {
    const double angle = i * 3.141592653589793 / 720;
    const double x = std::cos(angle), y = std::sin(angle);
    EXPECT_NEAR(elementary::atan2(y, x), std::atan2(y, x), 4 * ulp_of_1) << angle;
    EXPECT_NEAR(elementary::atan2(1e-200 * y, 1e-200 * x), std::atan2(y, x), 4 * ulp_of_1) << angle;
  }
  EXPECT_EQ(elementary::atan2(0, 0), 0.0);
  EXPECT_EQ(elementary::atan2(0, -1), std::atan2(0.0, -1.0));
}

TEST(Elementary, LogWithinThreeUlp) {
  const auto exact = [](double x) { return std::log(static_cast<long double>(x)); };
  // Near 1, too, where the logarithm is near 0.
  EXPECT_LT(worst(
                0.5, 1.0 - 1e-16, 200'000, [](double x) { return log(x); }, exact, relative),
            3.0);
  EXPECT_LT(worst(
                1.0 + 3e-16, 2.0, 200'000, [](double x) { return log(x); }, exact, relative),
            3.0);
  EXPECT_LT(worst(
                1.0 + 3e-16, 1.0 + 1e-6, 100'000, [](double x) { return log(x); }, exact, relative),
            3.0);
  for (double x = std::numeric_limits<double>::min(); x < 1e308; x *= 1.37)
    EXPECT_NEAR(log(x), static_cast<double>(exact(x)), 3.0 * ulp_of_1 * std::abs(std::log(x))) << x;
  EXPECT_EQ(log(1.0), 0.0);
}

TEST(Elementary, ExpWithinThreeUlp) {
  const auto exact = [](double x) { return std::exp(static_cast<long double>(x)); };
  for (double x = -700.0; x < 700.0; x += 0.0371) {
    const auto wanted = static_cast<double>(exact(x));
    EXPECT_NEAR(exp(x), wanted, 3.0 * ulp_of_1 * wanted) << x;
  }
  EXPECT_EQ(exp(0.0), 1.0);
  EXPECT_EQ(exp(-1e9), 0.0);
  EXPECT_TRUE(std::isfinite(exp(1e9)));
}

TEST(Elementary, SinCosWithinTwoUlpOfOne) {
  const auto sine = [](double x) { return std::sin(static_cast<long double>(x)); };
  const auto cosine = [](double x) { return std::cos(static_cast<long double>(x)); };
  for (const double to : {1e-6, 1.0, 10.0, 1e3, 1e5}) {
    SCOPED_TRACE(to);
    EXPECT_LT(worst(
                  -to, to, 200'000, [](double x) { return sincos(x).sin; }, sine, absolute),
              2.0);
    EXPECT_LT(worst(
                  -to, to, 200'000, [](double x) { return sincos(x).cos; }, cosine, absolute),
              2.0);
  }
  // At multiples of pi/2 one of the two is nearly 0, and equals the rounding error of the angle.
  for (int k = -60'000; k <= 60'000; k += 7) {
    const double x = k * 1.5707963267948966;
    const bool even = k % 2 == 0;
    const SinCos turned = sincos(x);
    EXPECT_NEAR(even ? turned.sin : turned.cos, static_cast<double>(even ? sine(x) : cosine(x)), 1e-25) << k;
    EXPECT_NEAR(even ? turned.cos : turned.sin, static_cast<double>(even ? cosine(x) : sine(x)), ulp_of_1) << k;
  }
}

TEST(Elementary, SinCosOfLanesHasTheBitsOfSinCos) {
  for (int i = -40'000; i < 40'000; ++i) {
    const Lanes x = {0.01 * i, 1.5707963267948966 * i, -1.37 * i, 1e-9 * i};
    const auto [sin, cos] = sincos(x);
    for (int lane = 0; lane < 4; ++lane) {
      const SinCos one = sincos(x[lane]);
      ASSERT_EQ(std::bit_cast<std::uint64_t>(sin[lane]), std::bit_cast<std::uint64_t>(one.sin)) << x[lane];
      ASSERT_EQ(std::bit_cast<std::uint64_t>(cos[lane]), std::bit_cast<std::uint64_t>(one.cos)) << x[lane];
    }
  }
}

TEST(Elementary, LogOfLanesHasTheBitsOfLog) {
  for (double x = std::numeric_limits<double>::min(); x < 1e300; x *= 1.00713) {
    const Lanes all = {x, 1.37 * x, 1.0 / (1.0 + x), 0.70710678118654752 + 1e-17 * x};
    const Lanes logs = log(all);
    for (int lane = 0; lane < 4; ++lane)
      ASSERT_EQ(std::bit_cast<std::uint64_t>(logs[lane]), std::bit_cast<std::uint64_t>(log(all[lane]))) << all[lane];
  }
}

TEST(Elementary, SmallSineKeepsAllDigits) {
  for (double x = 1e-300; x < 1e-3; x *= 11.0) EXPECT_NEAR(sincos(x).sin / std::sin(x), 1.0, 2.0 * ulp_of_1) << x;
}

// The same bits on every machine: any compiler, any level of optimisation, any processor.
TEST(Elementary, PinnedBits) {
  Hash hash;
  for (int i = 0; i < 100'000; ++i) {
    const double x = i * 1e-5;
    hash.add(atan_over_x(x));
    hash.add(log(1e-12 + x));
    const SinCos turned = sincos((i - 50'000) * 1.37);
    hash.add(turned.sin);
    hash.add(turned.cos);
    const EvenSeries even = even_series(12.0 * x);
    hash.add(even.sinc);
    hash.add(even.cos);
    hash.add(even.versine);
    hash.add(even.cubic);
    hash.add(inverse_normal_cdf((i + 0.5) * 1e-5));
    hash.add(inverse_normal_cdf(x * x * x * x + 1e-20));
  }
  EXPECT_EQ(hash.value(), 15749624205230948964U);
}

}  // namespace
}  // namespace imud::elementary
