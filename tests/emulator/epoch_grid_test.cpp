// The grids of samples on a clock that hosts share: the same instants on every host, whenever it has started and
// whatever its own clock is; on a simulated host.
#include "emulator/drive/epoch_grid.hpp"

#include <gtest/gtest.h>

#include "tests/emulator/simulated.hpp"

namespace imud {
namespace {

using namespace std::chrono_literals;

constexpr Nanoseconds in_2026 = 1'795'834'994s;  // since 1970

// A grid that a host has placed. Its own clock is behind the shared one by `ahead`.
struct OnHost {
  OnHost(const Grid& grid_, Nanoseconds ahead_, Nanoseconds ready) : grid(grid_), ahead(ahead_) {
    host.epoch_ahead = [this](HostTime) { return ahead; };
    placed = epoch.place(0, grid, epoch.start_from(HostTime{} + (ready - ahead)));
  }
  // Returns instant K by the shared clock.
  Nanoseconds instant(std::uint64_t K) const {
    return placed.origin + grid.offset(placed.first + (K - placed.number)) + ahead - HostTime{};
  }
  Grid grid;
  Nanoseconds ahead;
  SimulatedHost host;
  ClockCounters counters;
  EpochGrid epoch{host, Epoch::tai, 1, counters};
  EpochGrid::Placement placed;
};

// Returns phase + K/rate, rounded to the nearest ns.
Nanoseconds exact_instant(std::uint64_t K, std::uint64_t rate_uhz, Nanoseconds phase) {
  __extension__ using Wide = unsigned __int128;
  return phase + Nanoseconds(static_cast<std::int64_t>((Wide{K} * 1'000'000'000'000'000U + rate_uhz / 2) / rate_uhz));
}

// Exact to the nanosecond, after a thousand million samples, too. The second host has started some hours later.
TEST(EpochGrid, HostsHaveTheSameInstants) {
  for (const std::uint64_t rate_uhz : {1'000ULL, 300'000ULL, 7'000'000ULL, 200'000'000ULL, 333'300'000ULL,
                                       333'333'333ULL, 819'200'000ULL, 10'000'000'000ULL})
    for (const Nanoseconds phase : {0ns, 1'234'567ns}) {
      const Grid grid(1e-6 * static_cast<double>(rate_uhz), 0, phase);
      const OnHost early(grid, 1'795'000'000s + 123'456'789ns, in_2026 + 1ns);
      const OnHost late(grid, -77s - 5ns, in_2026 + 12'345s + 987'654'321ns);
      // The first instant is the first at or after the whole second.
      EXPECT_GE(early.instant(early.placed.number), in_2026 + 1s + phase);
      EXPECT_LT(exact_instant(early.placed.number - 1, rate_uhz, phase), in_2026 + 1s + phase);
      EXPECT_GE(late.placed.number, early.placed.number);
      for (const std::uint64_t later : {0ULL, 1'000'000'000ULL})
        for (std::uint64_t K = late.placed.number + later; K < late.placed.number + later + 1000; ++K) {
          if (later > 0 && rate_uhz < 1'000'000) break;  // after the 292 years of a HostTime
          ASSERT_EQ(late.instant(K), exact_instant(K, rate_uhz, phase)) << rate_uhz << ' ' << K;
          ASSERT_EQ(early.instant(K), late.instant(K)) << rate_uhz << ' ' << K;
        }
    }
}

// A reload has given an imu another grid, whose first instant is wherever the next sample was due.
TEST(EpochGrid, AnotherGridIsOnTheEpochAfterASample) {
  OnHost one(Grid(200), in_2026, in_2026);
  const Grid other(333.3);
  const HostTime next = one.placed.begin + 123ms;
  EXPECT_FALSE(one.epoch.follow(0, one.grid, 3, next));
  one.epoch.change(0);
  const auto placed = one.epoch.follow(0, other, 1, next);
  ASSERT_TRUE(placed);
  EXPECT_EQ(placed->begin + one.ahead - HostTime{}, exact_instant(placed->number, 333'300'000, 0ns));
  EXPECT_LE(std::chrono::abs(placed->begin - next), other.period() / 2 + 1ns);
  EXPECT_FALSE(one.epoch.follow(0, other, 1, next));
}

}  // namespace
}  // namespace imud
