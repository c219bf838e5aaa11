// The sensor's clock: between samples, over a step, and with an error against the host's.
#include "emulator/imu/device_clock.hpp"

#include <gtest/gtest.h>

namespace imud {
namespace {

using namespace std::chrono_literals;

constexpr HostTime power{5'000'000'000};

TEST(DeviceClock, RunsFromPowerOnByItsOwnError) {
  DeviceClock clock(Grid(100, 10'000));  // one per cent fast
  clock.power_on(power);
  EXPECT_EQ(clock.now(power), DeviceTime{0});
  EXPECT_EQ(clock.now(power + 100s), DeviceTime{101'000'000'000});
  EXPECT_EQ(clock.now(power + 99s), DeviceTime{101'000'000'000}) << "never back";
  EXPECT_EQ(clock.host_time(DeviceTime{202'000'000'000}), power + 200s);
}

// Instant k lies k/(1.01 * rate) after the grid's start, and is stamped k/rate.
TEST(DeviceClock, StampsNominalPeriodsAndAgreesBetweenThem) {
  const Grid grid(100, 10'000, 300us);
  DeviceClock clock(grid);
  clock.power_on(power);
  clock.start_samples();
  for (std::uint64_t k = 0; k < 1000; ++k) {
    const DeviceTime stamp = clock.stamp(k);
    EXPECT_EQ(stamp.ns, 300'000 + static_cast<std::int64_t>(k) * 10'000'000);
    const HostTime at = power + grid.offset(k);
    EXPECT_LE(std::abs((clock.now(at) - stamp).count()), 1) << k;
    EXPECT_EQ(clock.now(at + 1s), stamp) << "does not pass a sample that is still to be taken";
    clock.take_sample(stamp);
    EXPECT_LE(std::abs(clock.now(at + 5ms).ns - (stamp.ns + 5'050'000)), 1) << k;
  }
}

// The stamps stay nominal, and the clock reads them at the shifted instants.
TEST(DeviceClock, ReachesTheStampsAtShiftedInstants) {
  const Grid grid(100);
  DeviceClock clock(grid);
  clock.power_on(power);
  clock.start_samples();
  HostTime shifted = power;
  for (std::uint64_t k = 0; k < 1000; ++k) {
    const DeviceTime stamp = clock.stamp(k);
    EXPECT_EQ(stamp.ns, static_cast<std::int64_t>(k) * 10'000'000);
    const HostTime at = shifted + grid.offset(k);
    EXPECT_EQ(clock.host_time(stamp), at);
    EXPECT_EQ(clock.now(at), stamp) << k;
    clock.take_sample(stamp);
    const Nanoseconds by{k % 3 == 0 ? 700 : -500};
    clock.shift(by);
    EXPECT_EQ(clock.take_shift(), by);
    EXPECT_EQ(clock.take_shift(), 0ns);
    shifted = shifted + by;
    EXPECT_LE(std::abs((clock.now(at + 5ms) - stamp - 5ms).count()), 700) << k;
  }
  DeviceClock standing(grid);
  standing.set(DeviceTime{}, std::nullopt);
  standing.start_samples();
  standing.shift(1ms);
  EXPECT_EQ(standing.stamp(1).ns, 10'000'000);
}

TEST(DeviceClock, StandsBetweenSamplesWithoutAHostClock) {
  DeviceClock clock(Grid(200));
  EXPECT_EQ(clock.set(DeviceTime{7'000'000'000}, std::nullopt), 7s) << "power is taken to come on at sample 0";
  clock.start_samples();
  EXPECT_EQ(clock.now(power), DeviceTime{7'000'000'000});
  clock.take_sample(clock.stamp(0));
  clock.take_sample(clock.stamp(1));
  EXPECT_EQ(clock.now(power + 1s), DeviceTime{7'005'000'000});
  EXPECT_FALSE(clock.host_time(DeviceTime{7'010'000'000}));
  EXPECT_EQ(clock.set(DeviceTime{0}, std::nullopt), -7'010ms) << "the next sample was due a period later";
  EXPECT_EQ(clock.now(), DeviceTime{-5'000'000}) << "a period before sample 0";
}

// Sensors that are silent before the first truth have a clock from power-on, which is set by the truth's time.
TEST(DeviceClock, IsSetWhenTheFirstTruthComes) {
  DeviceClock clock(Grid(100));
  clock.power_on(power);
  EXPECT_EQ(clock.now(power + 60s), DeviceTime{60'000'000'000});
  const Nanoseconds step = clock.set(DeviceTime{1'000'000'000}, power + 61s);
  EXPECT_EQ(step, 1s - 61s);
  clock.start_samples();
  EXPECT_EQ(clock.now(power + 60'500ms), DeviceTime{500'000'000});
  EXPECT_EQ(clock.stamp(0), DeviceTime{1'000'000'000});
}

// At the host time of a deadline the clock has reached the deadline: a wake-up at that time is never too early. A
// deadline after the next sample has no host time yet.
TEST(DeviceClock, GivesHostTimesThatItKeeps) {
  DeviceClock clock(Grid(400, 333.3, 137us));
  clock.power_on(power);
  for (std::int64_t ns = 1; ns < 1'000'000'000; ns += 999'983) {
    const auto at = clock.host_time(DeviceTime{ns});
    ASSERT_TRUE(at);
    ASSERT_GE(clock.now(*at), DeviceTime{ns});
    ASSERT_LE(clock.now(*at), DeviceTime{ns + 2});
  }
  DeviceClock sampling(Grid(100));
  sampling.power_on(power);
  sampling.start_samples();
  sampling.take_sample(sampling.stamp(0));
  EXPECT_TRUE(sampling.host_time(sampling.stamp(1)));
  EXPECT_FALSE(sampling.host_time(sampling.stamp(1) + 1ns));
}

// A truth that had arrived before power came on.
TEST(DeviceClock, DoesNotGoBackAtAnEarlierTruth) {
  DeviceClock clock(Grid(100));
  clock.power_on(power);
  const DeviceTime before = clock.now(power + 1ms);
  const Nanoseconds step = clock.set(DeviceTime{7'000'000'000}, power - 1ms);
  clock.start_samples();
  EXPECT_EQ(before + step, clock.stamp(0));
  EXPECT_EQ(clock.now(), clock.stamp(0));
}

// The next sample keeps its stamp, and the clock does not jump.
TEST(DeviceClock, ChangesItsGridAtTheNextSample) {
  const Grid before(100, 10'000, 300us), after(1000, -10'000, 300us);
  DeviceClock clock(before);
  clock.power_on(power);
  clock.start_samples();
  for (std::uint64_t k = 0; k < 10; ++k) clock.take_sample(clock.stamp(k));
  const DeviceTime next = clock.stamp(10);
  clock.change(after);
  EXPECT_EQ(clock.next_sample(), next);
  const HostTime at = power + before.offset(10);
  EXPECT_LE(std::abs((clock.now(at) - next).count()), 1);
  for (std::uint64_t k = 0; k < 100; ++k) {
    EXPECT_EQ(clock.stamp(k), next + std::chrono::milliseconds(k));
    clock.take_sample(clock.stamp(k));
    EXPECT_LE(std::abs((clock.now(at + (after.offset(k) - after.offset(0))) - clock.stamp(k)).count()), 1) << k;
  }
  DeviceClock off(before);  // before the first sample
  off.power_on(power);
  off.change(after);
  off.start_samples();
  EXPECT_EQ(off.next_sample(), DeviceTime{300'000});
}

}  // namespace
}  // namespace imud
