#include "core/numbers/duration_histogram.hpp"

#include <gtest/gtest.h>

#include <array>
#include <thread>
#include <utility>
#include <vector>

namespace imud {
namespace {

TEST(DurationHistogram, Percentiles) {
  DurationHistogram histogram;
  EXPECT_EQ(histogram.percentile(50), 0.0);
  for (int i = 1; i <= 1000; ++i) histogram.add(1e-6 * i);
  EXPECT_NEAR(histogram.percentile(50), 500e-6, 12e-6);
  EXPECT_NEAR(histogram.percentile(99), 990e-6, 24e-6);
  EXPECT_EQ(histogram.percentile(100), 1000e-6);
  EXPECT_EQ(histogram.max(), 1000e-6);
  histogram.add(0);
  histogram.add(1e6);
  EXPECT_EQ(histogram.percentile(0.01), 0.0);
  EXPECT_EQ(histogram.percentile(100), 1e6);
  EXPECT_EQ(histogram.count(), 1002U);
}

// Percentiles are figures between the limits of buckets, not these or their middles.
TEST(DurationHistogram, PercentilesAreInterpolated) {
  DurationHistogram histogram;
  constexpr double first = 0x1p-10;  // begins a bucket
  for (int i = 0; i < 100'000; ++i) histogram.add(first * (1 + 1e-6 * i));
  for (const int percent : {1, 5, 25, 50, 63, 75, 95, 99}) {
    const double expected = first * (1 + 1e-3 * percent);
    EXPECT_NEAR(histogram.percentile(percent), expected, 2e-4 * expected) << percent;
  }
}

TEST(DurationHistogram, ShorterThanTheFirstBucketIsZero) {
  for (const auto& [duration, shown] : {std::pair{0.99e-7, 0.0}, {1.01e-7, 1.01e-7}, {1.03e-7, 1.03e-7}}) {
    DurationHistogram histogram;
    histogram.add(duration);
    histogram.add(1);
    EXPECT_NEAR(histogram.percentile(50), shown, 0.012 * shown) << duration;
  }
}

// Half of the widest bucket is 0.78 %.
TEST(DurationHistogram, LimitsAreExactWithinHalfABucket) {
  for (double limit = 2e-7; limit < 900; limit *= 1.0137) {
    DurationHistogram histogram;
    histogram.add(0.992 * limit);
    histogram.add(1.008 * limit);
    EXPECT_EQ(histogram.counts_up_to(std::array{limit}), std::vector<std::uint64_t>{1}) << limit;
  }
}

TEST(DurationHistogram, TheSumIsExact) {
  DurationHistogram histogram;
  for (const double duration : {1e-9, 0.5, 2000.0}) histogram.add(duration);
  const DurationHistogram before = histogram;
  histogram.add(0.25);
  EXPECT_EQ(histogram.sum(), 1e-9 + 0.5 + 2000.0 + 0.25);
  EXPECT_EQ(histogram.since(before).sum(), 0.25);
}

TEST(DurationHistogram, SinceAnEarlierCopy) {
  DurationHistogram histogram;
  for (int i = 1; i <= 1000; ++i) histogram.add(1e-3);
  histogram.add(5.0);
  const DurationHistogram before = histogram;
  EXPECT_EQ(histogram.since(before).count(), 0U);
  EXPECT_EQ(histogram.since(before).max(), 0.0);
  for (int i = 1; i <= 100; ++i) histogram.add(1e-6 * i);
  const DurationHistogram rest = histogram.since(before);
  EXPECT_EQ(rest.count(), 100U);
  EXPECT_NEAR(rest.percentile(50), 50e-6, 1.2e-6);
  EXPECT_NEAR(rest.max(), 100e-6, 2.4e-6);
  histogram.add(7.0);
  EXPECT_EQ(histogram.since(before).max(), 7.0);
  DurationHistogram assigned;
  assigned = histogram;
  EXPECT_EQ(assigned.count(), 1102U);
  EXPECT_EQ(assigned.max(), 7.0);
  EXPECT_EQ(assigned.percentile(50), histogram.percentile(50));
}

TEST(DurationHistogram, IsCopiedWhileAnotherThreadAdds) {
  DurationHistogram histogram;
  constexpr std::uint64_t n = 200'000;
  std::thread adder([&] {
    for (std::uint64_t i = 0; i < n; ++i) histogram.add(1e-6 * static_cast<double>(1 + i % 1000));
  });
  DurationHistogram before;
  std::uint64_t sum = 0;
  while (sum < n) {
    const DurationHistogram now = histogram;
    sum += now.since(before).count();
    before = now;
  }
  adder.join();
  EXPECT_EQ(sum, n);
}

// 99.9 % of whole thousands, which no product of doubles may exceed.
TEST(DurationHistogram, OneInAThousandIsBeyondTheLastPercentile) {
  for (int n = 1000; n <= 20'000; n += 1000) {
    DurationHistogram histogram;
    for (int i = 0; i < n; ++i) histogram.add(i < n / 1000 ? 1.0 : 1e-6);
    EXPECT_LT(histogram.percentile(99.9), 2e-6) << n;
  }
}

}  // namespace
}  // namespace imud
