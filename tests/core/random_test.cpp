#include "core/numbers/random.hpp"

#include <Random123/philox.h>
#include <Random123/threefry.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <set>
#include <thread>
#include <vector>

#include "core/numbers/normal_stock.hpp"
#include "tests/core/statistics.hpp"

namespace imud {
namespace {

// The library's own known answers (Random123's kat_vectors), to detect another version of it.
TEST(Random123, KnownAnswers) {
  const r123::Philox4x32 philox32;
  using Words = r123::Philox4x32::ctr_type;
  EXPECT_EQ(philox32({{0, 0, 0, 0}}, {{0, 0}}), (Words{{0x6627e8d5, 0xe169c58d, 0xbc57ac4c, 0x9b00dbd8}}));
  constexpr std::uint32_t ones = 0xffffffff;
  EXPECT_EQ(philox32({{ones, ones, ones, ones}}, {{ones, ones}}),
            (Words{{0x408f276d, 0x41c83b0e, 0xa20bc7c6, 0x6d5451fd}}));
  EXPECT_EQ(philox32({{0x243f6a88, 0x85a308d3, 0x13198a2e, 0x03707344}}, {{0xa4093822, 0x299f31d0}}),
            (Words{{0xd16cfe09, 0x94fdcceb, 0x5001e420, 0x24126ea1}}));
  const auto long_words = r123::Philox4x64{}({{0, 0, 0, 0}}, {{0, 0}});
  EXPECT_EQ(
      long_words,
      (r123::Philox4x64::ctr_type{{0x16554d9eca36314c, 0xdb20fe9d672d0fdc, 0xd7e772cee186176b, 0x7e68b68aec7ba23b}}));
}

// A batch gives the same bits as one number after another, in any order of samples.
TEST(NormalSequence, GivesTheDeviatesOfNormals) {
  const Normals normals(0x0123456789abcdef, 77);
  NormalSequence sequence(Quantity::specific_force, Process::white_noise);
  for (std::uint64_t k = 0; k < 50'000; ++k)
    ASSERT_EQ(sequence.at(normals, k), normals(Quantity::specific_force, Process::white_noise, k)) << k;
  for (const std::uint64_t k : {0xffff'fff0ULL, 0x1'0000'0005ULL, 0x1'ffff'ffffULL, 3ULL, 0x1234'5678'9abc'def0ULL})
    EXPECT_EQ(sequence.at(normals, k), normals(Quantity::specific_force, Process::white_noise, k)) << k;
}

// A stock that is filled at any time, also for another seed than the next number's, has the same numbers.
TEST(NormalStock, HasTheDeviatesOfNormalsWheneverItIsFilled) {
  Normals normals(5, 77);
  NormalStock stock(40);  // three batches
  NormalSequence sequence(Quantity::rate, Process::random_walk);
  sequence.take_from(stock);
  for (std::uint64_t k = 0; k < 20'000; ++k) {
    if (k % 5'000 == 4'999) {
      normals.set_seed(k);
      sequence.forget();
    }
    if (normals.uniform(Quantity::rate, Process::fault, k) < 0.04) stock.fill();
    ASSERT_EQ(sequence.at(normals, k), normals(Quantity::rate, Process::random_walk, k)) << k;
  }
}

// The next block is there once fill() has ended after the first number of a block, and nothing else is.
TEST(NormalStock, HasWhatWasRequested) {
  NormalStock stock(4 * NormalBatch::samples);
  NormalBatch batch = {.seed = 1, .stream = 2, .purpose = 3, .number = 0};
  NormalBatch::Deviates taken{}, own{};
  EXPECT_FALSE(stock.take(batch, taken));
  stock.fill();
  for (batch.number = 1; batch.number < 4; ++batch.number) EXPECT_FALSE(stock.take(batch, taken)) << batch.number;
  for (; batch.number < 8; ++batch.number) {
    EXPECT_TRUE(stock.take(batch, taken)) << batch.number;
    batch.compute(own);
    EXPECT_EQ(taken, own) << batch.number;
  }
  EXPECT_FALSE(stock.take(batch, taken)) << "requested, but not filled";
  stock.fill();
  EXPECT_TRUE(stock.take(batch, taken));
  for (NormalBatch other : {NormalBatch{2, 2, 3, 8}, NormalBatch{1, 3, 3, 8}, NormalBatch{1, 2, 4, 8}})
    EXPECT_FALSE(stock.take(other, taken));
}

// At least until a thousand batches were taken.
TEST(NormalStock, IsFilledByAnotherThread) {
  NormalStock stock(64);
  std::atomic<bool> ends = false;
  std::thread filling([&] {
    while (!ends) stock.fill();
  });
  NormalBatch batch = {.seed = 1, .stream = 2, .purpose = 3, .number = 0};
  NormalBatch::Deviates taken{}, own{};
  std::size_t there = 0, different = 0;
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(60);
  for (; batch.number < 10'000 || (there < 1000 && std::chrono::steady_clock::now() < end); ++batch.number) {
    batch.compute(own);
    if (!stock.take(batch, taken)) continue;
    ++there;
    different += taken != own ? 1U : 0U;
  }
  ends = true;
  filling.join();
  EXPECT_GE(there, 1000U);
  EXPECT_EQ(different, 0U);
}

TEST(InverseNormalCdf, KnownAnswersOfAs241) {
  EXPECT_NEAR(inverse_normal_cdf(0.25), -0.67448975019608171, 2e-16);
  EXPECT_NEAR(inverse_normal_cdf(0.001), -3.0902323061678132, 1e-15);
  EXPECT_NEAR(inverse_normal_cdf(1e-20), -9.2623400897984052, 4e-15);
  EXPECT_EQ(inverse_normal_cdf(0.5), 0.0);
}

// Phi(x) of the result is p again. A relative error e of x moves ln p by about e x^2 in the tail.
TEST(InverseNormalCdf, InvertsTheDistribution) {
  const auto check = [](double p) {
    const double x = inverse_normal_cdf(p);
    const auto back = static_cast<double>(0.5L * std::erfc(-static_cast<long double>(x) / std::sqrt(2.0L)));
    ASSERT_NEAR(back / p, 1.0, 1e-15 * (1.0 + x * x)) << p;
  };
  for (int i = 1; i < 100'000; ++i) check(i * 0.5e-5);
  for (double p = 0.5; p > 1e-300; p *= 0.91) check(p);
}

TEST(InverseNormalCdf, IsOddAndGrows) {
  double before = inverse_normal_cdf(0x1p-53);
  for (int i = 1; i < 1 << 16; ++i) {
    const double p = i * 0x1p-16;
    const double x = inverse_normal_cdf(p);
    ASSERT_GT(x, before) << p;
    ASSERT_EQ(x, -inverse_normal_cdf(1.0 - p)) << p;
    before = x;
  }
}

TEST(Uniform, IsInsideTheIntervalAndSymmetric) {
  EXPECT_EQ(uniform(0), 0x1p-53);
  EXPECT_EQ(uniform(~std::uint64_t{0}), 1.0 - 0x1p-53);
  EXPECT_NEAR(inverse_normal_cdf(uniform(~std::uint64_t{0})), 8.2095361516013874, 1e-14);
  for (const std::uint64_t bits : {0x0123456789abcdefU, 0x8000000000000000U, 0xfedcba9876543210U})
    EXPECT_EQ(uniform(bits) + uniform(~bits), 1.0);
}

TEST(Normals, AreThePhiloxWordsThroughTheInverse) {
  const std::uint64_t seed = 0x9e3779b97f4a7c15;
  const std::uint32_t stream = stream_id("imu1");
  const Normals of_imu(seed, stream);
  // Also across the carry of the counter's words, and enough for both tails.
  for (const std::uint64_t first : {std::uint64_t{0}, std::uint64_t{1} << 33U, std::uint64_t{0x123456789abc}})
    for (std::uint64_t k = std::max(first, std::uint64_t{1000}) - 1000; k < first + 1000; k += 2) {
      const Vector3 even = of_imu(Quantity::specific_force, Process::gauss_markov, k);
      const Vector3 odd = of_imu(Quantity::specific_force, Process::gauss_markov, k + 1);
      for (std::uint32_t axis = 0; axis < 3; ++axis) {
        const std::uint64_t counter = k / 2;
        const auto words = r123::Philox4x32{}({{static_cast<std::uint32_t>(counter),
                                                static_cast<std::uint32_t>(counter >> 32U), 1U << 4U | axis, stream}},
                                              {{0x7f4a7c15, 0x9e3779b9}});
        const auto expected = [&](std::size_t i) {
          const std::uint64_t bits = std::uint64_t{words[i + 1]} << 32U | words[i];
          return inverse_normal_cdf((static_cast<double>(bits >> 12U) + 0.5) * 0x1p-52);
        };
        ASSERT_EQ(even[static_cast<int>(axis)], expected(0)) << k;
        ASSERT_EQ(odd[static_cast<int>(axis)], expected(2)) << k;
      }
    }
}

TEST(Normals, StreamIdIsFnv1a) {
  EXPECT_EQ(stream_id(""), 0x811c9dc5U);
  EXPECT_EQ(stream_id("a"), 0xe40c292cU);
  EXPECT_EQ(stream_id("foobar"), 0xbf9cf968U);
}

TEST(Normals, EveryPartOfTheAddressMatters) {
  std::set<double> seen;
  std::size_t drawn = 0;
  for (const std::uint64_t seed : {0ULL, 1ULL, 2ULL, 1ULL << 32U, 1ULL << 63U})
    for (const std::uint32_t stream : {0U, 1U, stream_id("imu1"), stream_id("imu2")})
      for (const Quantity quantity : {Quantity::rate, Quantity::specific_force})
        for (const std::uint64_t k : {0ULL, 1ULL, 2ULL, 1ULL << 32U, 1ULL << 63U}) {
          const Vector3 n = Normals(seed, stream)(quantity, Process::gauss_markov, k);
          seen.insert({n.x(), n.y(), n.z()});
          drawn += 3;
        }
  EXPECT_EQ(seen.size(), drawn);
}

class NormalSeries : public ::testing::Test {
 protected:
  static constexpr std::size_t count = 200'000;
  static std::vector<double> series(Quantity quantity, int axis, std::uint32_t stream = 7, std::uint64_t seed = 11) {
    const Normals normals(seed, stream);
    std::vector<double> values(count);
    for (std::size_t k = 0; k < count; ++k) values[k] = normals(quantity, Process::gauss_markov, k)[axis];
    return values;
  }
};

// Bounds at 4.9 standard errors: each check of a right generator fails once in 1e6 seeds.
TEST_F(NormalSeries, MomentsAndDistribution) {
  const double n = static_cast<double>(count);
  for (const Quantity quantity : {Quantity::rate, Quantity::specific_force})
    for (int axis = 0; axis < 3; ++axis) {
      std::vector<double> x = series(quantity, axis);
      const Moments moments(x);
      EXPECT_LT(std::abs(moments.mean), 4.9 / std::sqrt(n));
      EXPECT_LT(std::abs(moments.variance - 1.0), 4.9 * std::sqrt(2.0 / n));
      EXPECT_LT(std::abs(moments.skewness), 4.9 * std::sqrt(6.0 / n));
      EXPECT_LT(std::abs(moments.kurtosis - 3.0), 4.9 * std::sqrt(24.0 / n));
      EXPECT_LT(std::abs(correlation(x, x, 1)), 4.9 / std::sqrt(n));
      // Kolmogorov-Smirnov: P(D sqrt(n) > 2.70) = 2 exp(-2 * 2.70^2) = 1e-6.
      EXPECT_LT(kolmogorov_distance(std::move(x)) * std::sqrt(n), 2.70);
    }
}

TEST_F(NormalSeries, AxesQuantitiesImusAndSeedsAreUncorrelated) {
  std::vector<std::vector<double>> all;
  for (int axis = 0; axis < 3; ++axis) {
    all.push_back(series(Quantity::rate, axis));
    all.push_back(series(Quantity::specific_force, axis));
    all.push_back(series(Quantity::rate, axis, 8));
    all.push_back(series(Quantity::rate, axis, 7, 12));
  }
  for (std::size_t i = 0; i < all.size(); ++i)
    for (std::size_t j = 0; j < i; ++j)
      for (const std::size_t lag : {0U, 1U})
        EXPECT_LT(std::abs(correlation(all[i], all[j], lag)), 4.9 / std::sqrt(double{count})) << i << " " << j;
}

// Chi-square over pairs of successive numbers and over pairs of axes, 16 x 16 cells of equal probability: 255 degrees
// of freedom, of which P(chi^2 > 374) = 1e-6 (Wilson-Hilferty).
TEST_F(NormalSeries, PairsFillThePlane) {
  const std::vector<double> x = series(Quantity::rate, 0), y = series(Quantity::rate, 1);
  const auto cell = [](double v) { return std::min(15, static_cast<int>(8.0 * std::erfc(-v / std::sqrt(2.0)))); };
  const auto chi_square = [&](const std::vector<double>& a, const std::vector<double>& b, std::size_t lag) {
    std::vector<double> cells(256, 0.0);
    for (std::size_t i = lag; i < a.size(); i += lag + 1)
      ++cells[static_cast<std::size_t>(16 * cell(a[i]) + cell(b[i - lag]))];
    double total = 0.0, sum = 0.0;
    for (const double c : cells) total += c;
    for (const double c : cells) sum += (c - total / 256) * (c - total / 256) / (total / 256);
    return sum;
  };
  EXPECT_LT(chi_square(x, y, 0), 374.0);
  EXPECT_LT(chi_square(x, x, 1), 374.0);
}

}  // namespace
}  // namespace imud
