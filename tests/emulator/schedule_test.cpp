#include "emulator/schedule.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <tuple>
#include <vector>

namespace imud {
namespace {

using namespace std::chrono_literals;

TEST(Schedule, MergesEveryGridInOrder) {
  const std::vector<Grid> grids = {Grid(1000), Grid(1000, 200),         Grid(409.6, -35, 300us),
                                   Grid(1),    Grid(4000, 0, 62'500ns), Grid(1000)};
  std::vector<std::tuple<Nanoseconds, std::size_t, std::uint64_t>> wanted;
  for (std::size_t imu = 0; imu < grids.size(); ++imu)
    for (std::uint64_t k = 0; grids[imu].offset(k) <= 2s; ++k) wanted.emplace_back(grids[imu].offset(k), imu, k);
  std::sort(wanted.begin(), wanted.end());

  Schedule schedule(grids);
  for (int round = 0; round < 2; ++round) {
    for (const auto& [time, imu, k] : wanted) {
      const Schedule::Instant& next = schedule.next();
      ASSERT_EQ(std::make_tuple(next.since_start, next.imu, next.index), std::make_tuple(time, imu, k));
      schedule.advance();
    }
    EXPECT_GT(schedule.next().since_start, 2s);
    schedule.restart();
  }
}

}  // namespace
}  // namespace imud
