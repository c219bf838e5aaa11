#include "emulator/engine/schedule.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <tuple>
#include <vector>

namespace imud {
namespace {

using namespace std::chrono_literals;

// An instant that shifts takes the later ones of its imu with it, and no other imu's.
TEST(Schedule, ShiftsTheLaterInstantsOfAnImu) {
  const std::vector<Grid> grids = {Grid(1000), Grid(1000)};
  Schedule schedule(grids);
  for (std::size_t imu : {0U, 1U}) schedule.start(imu, 0ns);
  std::vector<std::pair<std::size_t, std::int64_t>> taken;
  for (int i = 0; i < 8; ++i) {
    const Schedule::Slot slot = schedule.next();
    taken.emplace_back(slot.imu, slot.offset.count());
    schedule.advance(slot.imu == 0 ? Nanoseconds{slot.index == 1 ? -3 : 10} : 0ns);
  }
  const std::vector<std::pair<std::size_t, std::int64_t>> wanted = {
      {0, 0}, {1, 0}, {1, 1'000'000}, {0, 1'000'010}, {1, 2'000'000}, {0, 2'000'007}, {1, 3'000'000}, {0, 3'000'017}};
  EXPECT_EQ(taken, wanted);
  schedule.change(0, Grid(500));
  EXPECT_EQ(schedule.next().imu, 1U);
  schedule.advance();
  EXPECT_EQ(schedule.next().offset, 4'000'027ns);
  schedule.start(0, 5ms);
  schedule.advance();
  EXPECT_EQ(schedule.next().offset, 5ms);
}

// A grid that starts late has the instants that it would have there, to the nanosecond.
TEST(Schedule, StartsAGridAtAnyOfItsInstants) {
  const std::vector<Grid> grids = {Grid(1000), Grid(333.3, 0, 17us)};
  Schedule schedule(grids);
  schedule.start(0, 0ns);
  constexpr std::uint64_t first = 598'561'828'234;
  const Nanoseconds origin = -grids[1].offset(first);
  schedule.start(1, origin, first);
  for (std::uint64_t index = 0; index < 1000;) {
    EXPECT_EQ(schedule.next(1).index, index);
    EXPECT_EQ(schedule.next(1).offset, origin + grids[1].offset(first + index));
    EXPECT_EQ(schedule.next(0).imu, 0U);
    index += schedule.next().imu;
    schedule.advance();
  }
}

TEST(Schedule, MergesEveryGridInOrder) {
  const std::vector<Grid> grids = {Grid(1000), Grid(1000, 200),         Grid(409.6, -35, 300us),
                                   Grid(1),    Grid(4000, 0, 62'500ns), Grid(1000)};
  std::vector<std::tuple<Nanoseconds, std::size_t, std::uint64_t>> wanted;
  for (std::size_t imu = 0; imu < grids.size(); ++imu)
    for (std::uint64_t k = 0; grids[imu].offset(k) <= 2s; ++k) wanted.emplace_back(grids[imu].offset(k), imu, k);
  std::sort(wanted.begin(), wanted.end());

  Schedule schedule(grids);
  EXPECT_TRUE(schedule.empty());
  for (int round = 0; round < 2; ++round) {
    for (std::size_t imu = 0; imu < grids.size(); ++imu) schedule.start(imu, 0ns);
    for (const auto& [time, imu, k] : wanted) {
      const Schedule::Slot& next = schedule.next();
      ASSERT_EQ(std::make_tuple(next.offset, next.imu, next.index), std::make_tuple(time, imu, k));
      schedule.advance();
    }
    EXPECT_GT(schedule.next().offset, 2s);
  }
}

// A grid may start later than the others, or restart: its instants begin there, and the others do not change.
TEST(Schedule, StartsEachGridByItself) {
  const std::vector<Grid> grids = {Grid(1000), Grid(500), Grid(1000, 0, 250us)};
  Schedule schedule(grids);
  schedule.start(0, 0ns);
  std::vector<std::tuple<Nanoseconds, std::size_t, std::uint64_t>> seen;
  const auto run_to = [&](Nanoseconds end) {
    for (; schedule.next().offset < end; schedule.advance())
      seen.emplace_back(schedule.next().offset, schedule.next().imu, schedule.next().index);
  };
  run_to(3ms);
  schedule.start(2, 2'900us);
  schedule.start(1, 3ms);
  run_to(5ms);
  schedule.start(1, 6ms);
  run_to(7ms);
  const decltype(seen) wanted = {{0ms, 0, 0},     {1ms, 0, 1}, {2ms, 0, 2},     {3ms, 0, 3}, {3ms, 1, 0},
                                 {3'150us, 2, 0}, {4ms, 0, 4}, {4'150us, 2, 1}, {5ms, 0, 5}, {5'150us, 2, 2},
                                 {6ms, 0, 6},     {6ms, 1, 0}, {6'150us, 2, 3}};
  EXPECT_EQ(seen, wanted);
}

// The next instant stays; from there on the new grid counts.
TEST(Schedule, ChangesAGridAtItsNextInstant) {
  const std::vector<Grid> grids = {Grid(1000), Grid(500, 0, 100us), Grid(100)};
  Schedule schedule(grids);
  schedule.start(0, 0ns);
  schedule.start(1, 0ns);
  std::vector<std::tuple<Nanoseconds, std::size_t, std::uint64_t>> seen;
  const auto run_to = [&](Nanoseconds end) {
    for (; schedule.next().offset < end; schedule.advance())
      seen.emplace_back(schedule.next().offset, schedule.next().imu, schedule.next().index);
  };
  run_to(3ms);
  schedule.change(0, Grid(4000));
  schedule.change(1, Grid(1000, 0, 100us));
  schedule.change(2, Grid(2000));  // not started
  run_to(4ms);
  schedule.start(2, 4ms);
  run_to(5ms);
  const decltype(seen) wanted = {{0ms, 0, 0},     {100us, 1, 0},   {1ms, 0, 1},     {2ms, 0, 2},
                                 {2'100us, 1, 1}, {3ms, 0, 0},     {3'250us, 0, 1}, {3'500us, 0, 2},
                                 {3'750us, 0, 3}, {4ms, 0, 4},     {4ms, 2, 0},     {4'100us, 1, 0},
                                 {4'250us, 0, 5}, {4'500us, 0, 6}, {4'500us, 2, 1}, {4'750us, 0, 7}};
  EXPECT_EQ(seen, wanted);
}

}  // namespace
}  // namespace imud
