#include "core/time.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <concepts>
#include <cstdint>
#include <random>

#include "core/gps_time.hpp"

namespace imud {
namespace {

template <class A, class B>
concept Addable = requires(A a, B b) {
  a + b;
};
template <class A, class B>
concept Subtractable = requires(A a, B b) {
  a - b;
};
template <class A, class B>
concept Comparable = requires(A a, B b) {
  a < b;
}
|| requires(A a, B b) { a == b; };

// These must not compile.
static_assert(!Addable<TruthTime, TruthTime>);
static_assert(!Addable<HostTime, HostTime>);
static_assert(!Addable<DeviceTime, DeviceTime>);
static_assert(!Addable<TruthTime, HostTime>);
static_assert(!Addable<HostTime, DeviceTime>);
static_assert(!Addable<DeviceTime, TruthTime>);
static_assert(!Subtractable<TruthTime, HostTime>);
static_assert(!Subtractable<HostTime, DeviceTime>);
static_assert(!Subtractable<DeviceTime, TruthTime>);
static_assert(!Comparable<TruthTime, HostTime>);
static_assert(!Comparable<HostTime, DeviceTime>);
static_assert(!Comparable<DeviceTime, TruthTime>);
static_assert(!std::convertible_to<TruthTime, HostTime> && !std::constructible_from<HostTime, TruthTime>);
static_assert(!std::assignable_from<DeviceTime&, TruthTime>);
static_assert(!std::convertible_to<TruthTime, std::int64_t> && !std::convertible_to<std::int64_t, TruthTime>);

// These must compile, so that the lines above fail for the right reason.
static_assert(Addable<TruthTime, Nanoseconds> && Subtractable<TruthTime, Nanoseconds>);
static_assert(Subtractable<TruthTime, TruthTime> && Comparable<TruthTime, TruthTime>);
static_assert(std::same_as<decltype(HostTime{} - HostTime{}), Nanoseconds>);

using namespace std::chrono_literals;

TEST(TimePoint, Arithmetic) {
  const TruthTime t{1'000};
  EXPECT_EQ((t + 5us).ns, 6'000);
  EXPECT_EQ((t - 5us).ns, -4'000);
  EXPECT_EQ((t + 5us) - t, 5us);
  EXPECT_LT(t - 1ns, t);
  EXPECT_EQ(t + 0ns, t);
  EXPECT_DOUBLE_EQ(seconds(2500ms), 2.5);
}

__extension__ using Wide = unsigned __int128;

// k/rate to the nearest ns, half up.
std::uint64_t exact_offset(std::uint64_t k, std::uint64_t rate_uhz) {
  const Wide twice = 2 * Wide{k} * 1'000'000'000'000'000U + rate_uhz;
  return static_cast<std::uint64_t>(twice / (2 * Wide{rate_uhz}));
}

// The last instant within 9.2e18 ns, 291.5 years.
std::uint64_t last_instant(double rate_hz) { return 9'200 * static_cast<std::uint64_t>(rate_hz * 1e6 + 0.5); }

class GridAtRate : public ::testing::TestWithParam<double> {};

TEST_P(GridAtRate, IsExactFor291Years) {
  const std::uint64_t last = last_instant(GetParam());
  const auto rate_uhz = static_cast<std::uint64_t>(GetParam() * 1e6 + 0.5);
  const Grid grid(GetParam());
  const auto check = [&](std::uint64_t k) {
    ASSERT_EQ(static_cast<std::uint64_t>(grid.offset(k).count()), exact_offset(k, rate_uhz)) << k;
  };
  for (std::uint64_t k = 0; k < 100'000; ++k) check(k);
  for (std::uint64_t k = 0; k <= std::min<std::uint64_t>(last, 1'000'000'000); k += 9'973) check(k);
  std::mt19937_64 random(1);
  for (int i = 0; i < 100'000; ++i) check(random() % last);
  for (std::uint64_t k = last - 1'000; k <= last; ++k) check(k);
}

TEST_P(GridAtRate, NeverDriftsFromThePeriod) {
  const Grid grid(GetParam());
  const double period_ns = 1e9 / GetParam();
  for (std::uint64_t k = 999'990'000; k < 1'000'000'000; ++k) {
    const auto step = static_cast<double>((grid.offset(k + 1) - grid.offset(k)).count());
    ASSERT_NEAR(step, period_ns, 1.0 + period_ns * 1e-6 / GetParam()) << k;
  }
}

TEST_P(GridAtRate, AWalkHasTheSameInstants) {
  for (const double ppm : {0.0, 0.001, -99.999, 12'345.678, 1e5, -1e5})
    for (const std::uint64_t begin :
         {std::uint64_t{0}, std::uint64_t{1}, last_instant(GetParam()) / 10 * 9 - 20'000}) {
      const Grid grid(GetParam(), ppm, 1'250us);
      Grid::Walk walk(grid, begin), nominal(grid, begin, true);
      for (std::uint64_t k = begin; k < begin + 20'000; ++k, walk.advance(), nominal.advance()) {
        ASSERT_EQ(walk.k(), k);
        ASSERT_EQ(walk.offset(), grid.offset(k)) << k << " " << ppm;
        ASSERT_EQ(nominal.offset(), grid.nominal_offset(k)) << k << " " << ppm;
      }
    }
}

INSTANTIATE_TEST_SUITE_P(Rates, GridAtRate,
                         ::testing::Values(Grid::min_rate_hz, 0.333333, 1.0, 7.0, 59.94, 100.0, 333.333333, 400.0,
                                           819.2, 999.999999, 1024.0, 3333.0, 4250.0, 9999.999999,
                                           Grid::max_rate_hz));

// GPS week 2347 began on 2024-12-29; GPS time 1 419 724 818 s is 2025-01-01 00:00 UTC.
TEST(GpsTime, IsAheadOfUtcSinceItsEpoch) {
  constexpr std::int64_t begin_of_2025 = 1'735'689'600, gps_s = 1'419'724'818;
  static_assert(gps_ns_from_unix(begin_of_2025) == gps_s * 1'000'000'000);
  EXPECT_EQ(gps_ns_from_unix(begin_of_2025), 2347 * gps_week_ns + (3 * 86'400 + gps_leap_s) * 1'000'000'000);
  const std::chrono::sys_time<Nanoseconds> utc = utc_from_gps(gps_s * 1'000'000'000 + 7);
  EXPECT_EQ(utc.time_since_epoch(), Nanoseconds(begin_of_2025 * 1'000'000'000 + 7));
  EXPECT_EQ(utc_from_gps(0), gps_epoch - std::chrono::seconds(gps_leap_s));
}

TEST(Grid, IsUsableAtCompileTime) {
  static_assert(Grid(200.0).offset(0) == 0ns);
  static_assert(Grid(200.0).offset(3) == 15ms);
  static_assert(Grid(3.0).offset(1) == 333'333'333ns);
  static_assert(Grid(3.0).offset(2) == 666'666'667ns);
  static_assert(Grid(10'000.0).offset(9'999'999'999'999U) == 999'999'999'999'900us);
}

TEST(Grid, APhaseShiftsEveryInstant) {
  static_assert(Grid(200.0, 0.0, 1'250us).offset(0) == 1'250us);
  static_assert(Grid(200.0, 0.0, 1'250us).offset(3) == 16'250us);
}

// instant k / (rate (1 + error)), to the nearest ns, in integers of another arrangement.
TEST(Grid, AClockErrorIsExactForBillionsOfSamples) {
  for (const double ppm : {0.001, -0.001, 1.0, -2.5, 50.0, -99.999, 12'345.678, 1e5, -1e5}) {
    const Grid grid(1000.0, ppm);
    const auto rate_in_1e12ths = static_cast<std::uint64_t>(std::llround(1e12 + ppm * 1e6));
    for (std::uint64_t k = 0; k <= 1'000'000'000'000; k = k * 3 + 1) {
      const Wide twice = 2 * Wide{k} * 1'000'000U * 1'000'000'000'000U + rate_in_1e12ths;
      ASSERT_EQ(Wide(static_cast<std::uint64_t>(grid.offset(k).count())), twice / (2 * Wide{rate_in_1e12ths})) << ppm;
      ASSERT_EQ(grid.nominal_offset(k), Nanoseconds(static_cast<std::int64_t>(k) * 1'000'000)) << ppm;
    }
  }
  static_assert(Grid(1000.0, 1e5).period() == 909'091ns);
  static_assert(Grid(1000.0, -1e5).period() == 1'111'111ns);
}

}  // namespace
}  // namespace imud
