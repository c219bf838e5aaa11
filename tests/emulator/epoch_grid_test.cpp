// The grids of samples on a clock that hosts share: the same instants on every host, whenever it has started and
// whatever its own clock is; on a simulated host.
#include "emulator/drive/epoch_grid.hpp"

#include "emulator/record/recorder.hpp"
#include "tests/emulator/record/record_test.hpp"

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

// Also if an imu's period is so long that a thousandth of it is longer than the step.
TEST(EpochGrid, AStepBetweenTheSamplesOfASlowImuIsCounted) {
  OnHost one(Grid(0.001), in_2026, in_2026);
  one.host.spend(1000s);
  one.ahead += 500us;  // a rate that is off by 0.5 ppm
  one.epoch.update(one.host.now());
  EXPECT_EQ(one.counters.steps, 0U);
  EXPECT_TRUE(one.epoch.moves(0));
  one.host.spend(1000s);
  one.ahead += 500ms;
  one.epoch.update(one.host.now());
  EXPECT_EQ(one.counters.steps, 1U);
  EXPECT_NEAR(one.counters.last_step, 0.5, 1e-9);
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

class EpochRun : public RecordTest {
 protected:
  // Runs for 8 s, with truth from second 1 on. `ahead_s`: of the shared clock against the host's, after so many
  // seconds; with 0.25 the first truth comes a quarter of a second after a whole second.
  void run(Config c, const std::function<double(double)>& ahead_s) {
    config_ = std::move(c);
    config_.realtime.epoch = Epoch::tai;
    run_.emplace(config_);
    const HostTime begin = run_->at(0);
    run_->host().epoch_ahead = [=](HostTime now) {
      return in_2026 - (begin - HostTime{}) + nanoseconds(ahead_s(seconds(now - begin)));
    };
    for (int k = 0; k < 700; ++k) run_->truth(1 + 0.01 * k, Swing::truth(at_s(0.01 * k)));
    run_->run(8);
    expect_continuous();
  }
  // Counters have no gap, stamps are nominal but for a rounding at each of at most 80 changes, and no two samples are
  // closer than half a period, or further apart than one and a half.
  void expect_continuous() {
    const std::vector<Left>& left = run_->left();
    ASSERT_GT(static_cast<double>(left.size()), 5 * config_.imus[0].rate_hz);
    const Grid grid = config_.imus[0].grid;
    for (std::size_t k = 0; k < left.size(); ++k) {
      ASSERT_EQ(left[k].sample.counter, k);
      ASSERT_NEAR(static_cast<double>((left[k].sample.time - left[0].sample.time).count()),
                  static_cast<double>((grid.nominal_offset(k) - grid.nominal_offset(0)).count()), 41);
      if (k == 0) continue;
      const double interval = seconds(left[k].time - left[k - 1].time) / grid.period_s();
      ASSERT_GT(interval, 0.49) << k;
      ASSERT_LT(interval, 1.51) << k;
    }
  }
  double host_s(std::size_t k) const { return run_->since_begin(run_->left()[k].time); }
  // How long after the nearest instant of the nominal grid sample k has left, by the shared clock, s.
  double after_grid_s(std::size_t k) {
    const HostTime left = run_->left()[k].time;
    const Nanoseconds clock = left + run_->host().epoch_ahead(left) - HostTime{};
    const ImuConfig& imu = config_.imus[0];
    const double K = std::round(seconds(clock - imu.grid.phase()) * imu.rate_hz);  // below 2^53, exact to 1e-4
    return seconds(clock - imu.grid.nominal_offset(static_cast<std::uint64_t>(K)));
  }
  const ClockCounters& clock() { return run_->clock(); }

  static constexpr double tolerance_s = 30e-6;  // what 100 ppm is in 0.2 s, and 10 us for the loop
  Config config_;
  std::optional<SimulatedRun> run_;
};

TEST_F(EpochRun, TheFirstSampleIsAfterAWholeSecond) {
  run(config(200, "", "phase_us = 700"), [](double) { return 0.25; });
  EXPECT_NEAR(host_s(0), 1.7507, tolerance_s);
  EXPECT_EQ(run_->counters().first_k, (in_2026.count() / 1'000'000'000 + 2) * 200);
  EXPECT_NEAR(1e-9 * static_cast<double>(run_->left()[0].sample.time.ns), 0.7507, 10e-6) << "the simulation's time";
  EXPECT_NEAR(navigate(run_->left(), 0.7507)[100].time_s, 1.2507, 1e-4);

  run(config(200, "", "before_first = \"rest\""), [](double) { return 0.25; });
  EXPECT_NEAR(host_s(0), 0.75, tolerance_s);
  EXPECT_EQ(run_->left()[0].sample.time, DeviceTime{0});
  EXPECT_EQ(run_->left()[0].sample.status, status::at_rest);
}

// The host's own clock is off by up to 100 ppm against the shared one, which is set after 4 s.
TEST_F(EpochRun, AHostWithAnotherRateAndAStepIsOnTheGrid) {
  for (const double rate_hz : {7.0, 200.0, 333.3})
    for (const double ppm : {0.0, 100.0, -100.0}) {
      const auto ahead_s = [ppm](double t) { return 0.25 + 1e-6 * ppm * t + (t > 4 ? 3.7e-3 : 0); };
      run(config(rate_hz, ""), ahead_s);
      std::size_t checked = 0;
      for (std::size_t k = 1; k < run_->left().size(); ++k) {           // sample 0 was placed up to a second before
        if (host_s(k) > 4 && host_s(k) < 4.12 + 2 / rate_hz) continue;  // until the step is noticed
        ASSERT_NEAR(after_grid_s(k), 0, tolerance_s) << rate_hz << " Hz, " << ppm << " ppm, " << host_s(k) << " s";
        checked += host_s(k) > 4 ? 1 : 0;
      }
      EXPECT_GT(checked, 20U);
      EXPECT_EQ(clock().steps, 1U);
      EXPECT_NEAR(clock().last_step, 3.7e-3, tolerance_s);
      EXPECT_EQ(run_->counters().missed, 0U);
    }
}

// The clock is set before the first truth, when there is no sample yet that could move.
TEST_F(EpochRun, AStepBeforeTheGridIsPlacedIsNone) {
  run(config(200, ""), [](double t) { return t > 0.5 ? 0.25 : 0.05; });
  EXPECT_EQ(clock().steps, 0U);
  for (std::size_t k = 0; k < run_->left().size(); ++k) ASSERT_NEAR(after_grid_s(k), 0, tolerance_s) << host_s(k);
}

// UTC is set back by a second, in which a whole number of periods fits.
TEST_F(EpochRun, ALeapSecondIsCountedAndMovesNothing) {
  run(config(200, ""), [](double t) { return t > 4.3 ? -0.75 : 0.25; });
  EXPECT_EQ(clock().steps, 1U);
  EXPECT_NEAR(clock().last_step, -1, 1e-6);
  for (std::size_t k = 1; k < run_->left().size(); ++k)
    ASSERT_NEAR(seconds(run_->left()[k].time - run_->left()[k - 1].time), 5e-3, 10e-6) << host_s(k);
}

// A unit with a clock error starts on the grid and leaves it. A step of the clock does not put it back.
TEST_F(EpochRun, AClockErrorMovesAUnitOffTheGrid) {
  run(config(200, "", "clock_error_ppm = 200"), [](double t) { return t > 4 ? 0.2517 : 0.25; });
  std::size_t checked = 0;
  for (std::size_t k = 0; k < run_->left().size(); ++k) {
    if (host_s(k) > 4 && host_s(k) < 4.12) continue;
    ASSERT_NEAR(after_grid_s(k), -200e-6 * (host_s(k) - host_s(0)), tolerance_s) << host_s(k);
    ++checked;
  }
  EXPECT_GT(checked, 1000U);
  EXPECT_EQ(clock().steps, 1U);
}

// Less than the uncertainty of the readings is no change.
TEST_F(EpochRun, AnUncertainReadingMovesNothing) {
  int n = 0;
  run(config(200, ""), [&n](double) { return 0.25 + (++n % 2 == 0 ? 1e-6 : 0); });
  for (std::size_t k = 1; k < run_->left().size(); ++k)
    ASSERT_EQ((run_->left()[k].time - run_->left()[k - 1].time).count(), 5'000'000) << k;
  EXPECT_EQ(clock().steps, 0U);
}

TEST_F(EpochRun, ARecordWithAStepRepeatsTheBytes) {
  Config c = config(333.3, "");
  c.realtime.epoch = Epoch::utc;
  Recorder recorder(options(), true);
  SimulatedRun run(c);
  run.recorder = &recorder;
  std::string sent;
  run.make_sensor = [&](SimulatedHost&) { return std::make_unique<KeptLine>(sent); };
  run.host().epoch_ahead = [step = run.at(3)](HostTime now) { return in_2026 + (now > step ? 1'234'567ns : 0ns); };
  for (int k = 0; k < 400; ++k) run.truth(1 + 0.01 * k, Swing::truth(at_s(0.01 * k)));
  run.run(5);
  recorder.finish();
  EXPECT_EQ(run.clock().steps, 1U);
  EXPECT_GT(run.counters().samples, 900U);
  EXPECT_TRUE(repeat(c)[0] == sent);
}

}  // namespace
}  // namespace imud
