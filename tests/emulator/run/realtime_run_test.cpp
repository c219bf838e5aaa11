// The real-time loop when truth stops, pauses, jumps or restarts, when the host is stopped for a while, and with many
// imus; on a simulated clock.
#include "emulator/config/load_config.hpp"
#include "tests/emulator/run/realtime_test.hpp"

namespace imud {
namespace {

using namespace std::chrono_literals;

class RealtimeRun : public RealtimeTest {
 protected:
  // Sends truths from `from_s` to `until_s` of simulation time, every 10 ms; each arrives 0.1 s + `late_s` after its
  // time.
  static void send(SimulatedRun& run, double from_s, double until_s, double late_s = 0, bool new_run = false) {
    for (int k = static_cast<int>(std::lround(from_s * 100)); k <= std::lround(until_s * 100); ++k) {
      Truth truth = Swing::truth(at_s(0.01 * k));
      truth.new_run = std::exchange(new_run, false);
      run.truth(0.1 + 0.01 * k + late_s, truth);
    }
  }
  // The frames sent within that time.
  static std::vector<Left> within(const SimulatedRun& run, double from_s, double until_s) {
    std::vector<Left> some;
    for (const Left& left : run.left())
      if (left.time >= run.at(from_s) && left.time < run.at(until_s)) some.push_back(left);
    return some;
  }
  static constexpr std::uint32_t held = status::truth_stale | status::truth_extrapolated;

  // Frames sent within that time show the motion `ahead_s` later than the time since the simulator's start.
  static void expect_truth(const SimulatedRun& run, double from_s, double until_s, double ahead_s) {
    const std::vector<Left> some = within(run, from_s, until_s);
    ASSERT_GT(static_cast<double>(some.size()), 900 * (until_s - from_s)) << "at 1 kHz";
    for (const Left& left : some) {
      ASSERT_EQ(left.sample.status, 0U);
      ASSERT_NEAR(left.sample.rate.z(), Swing::truth(at_s(run.since_begin(left.time) + ahead_s)).omega_BN_B.z(),
                  1e-3);
    }
  }
};

// Truth is missing from 2 s to 3 s of the simulation, which continues meanwhile.
TEST_F(RealtimeRun, WhenTruthStopsMotionIsHeldAndTheSumsReturn) {
  SimulatedRun run(config(1000, "extrapolate_ms = 100"));
  send(run, 0, 2);
  send(run, 3, 5);
  run.run(5.1);
  expect_grid(run.left(), Grid(1000), run.at(0.1), 20us);
  EXPECT_EQ(run.quality().stops, 1U);
  EXPECT_EQ(run.quality().returns, 1U);
  EXPECT_EQ(run.quality().resumed, 0U);
  EXPECT_NEAR(static_cast<double>(run.counters().held), 900, 2);
  EXPECT_EQ(run.counters().silent, 0U);
  const std::vector<Left> some = within(run, 2.25, 3.05);
  ASSERT_GT(some.size(), 700U);
  for (const Left& left : some) {
    ASSERT_EQ(left.sample.status & 0x1FFU, held);
    ASSERT_EQ(left.sample.rate.norm(), 0.0);
    ASSERT_EQ(left.sample.delta_angle.norm(), 0.0);
    ASSERT_EQ(left.sample.specific_force, some.front().sample.specific_force);
    ASSERT_NEAR(left.sample.delta_velocity.z(), 1e-3 * Swing::lift, 1e-9);
  }
  const auto all = navigate(run.left(), 0);
  for (const auto& r : all)
    if (run.since_begin(r.host) > 3.2) {
      ASSERT_NEAR(r.angle, Swing::angle(r.time_s), Swing::angle_error(0.012));
      ASSERT_NEAR(r.time_s, run.since_begin(r.host) - 0.1, 1e-3);
    }
}

TEST_F(RealtimeRun, WhenTruthStopsTheSampleIsFlaggedOrNotSent) {
  for (const std::string reaction : {"flag", "silence"}) {
    SimulatedRun run(config(1000, "extrapolate_ms = 100\nwhen_stopped = \"" + reaction + "\""));
    send(run, 0, 2);
    send(run, 3, 5);
    run.run(5.1);
    const std::vector<Left> some = within(run, 2.25, 3.05);
    EXPECT_EQ(run.quality().stops, 1U);
    EXPECT_EQ(run.quality().returns, 1U);
    if (reaction == "flag") {
      ASSERT_GT(some.size(), 700U);
      for (const Left& left : some) ASSERT_EQ(left.sample.status & 0x1FFU, held | status::not_valid);
      expect_grid(run.left(), Grid(1000), run.at(0.1), 20us);
    } else {
      EXPECT_TRUE(some.empty());
      EXPECT_NEAR(static_cast<double>(run.counters().silent), 900, 2);
      EXPECT_EQ(run.counters().samples, run.left().size() + run.counters().silent);
      // The counter continues, so that a host sees how many samples it has missed; the instants stay on the grid.
      for (const Left& left : run.left())
        ASSERT_EQ((left.time - run.at(0.1)) / 1ms, static_cast<std::int64_t>(left.sample.counter));
    }
    for (const Left& left : within(run, 3.2, 5.1)) ASSERT_EQ(left.sample.status & status::not_valid, 0U);
  }
}

// The fault changes what the sensor says of itself, not that it has no truth.
TEST_F(RealtimeRun, AFlagThatLiesDoesNotHideThatTruthHasStopped) {
  const std::string lie = "[[fault]]\ntarget = \"message\"\nkind = \"valid\"\n";
  for (const std::string reaction : {"flag", "silence"}) {
    SimulatedRun run(config(1000, "extrapolate_ms = 100\nwhen_stopped = \"" + reaction + "\"", lie));
    send(run, 0, 2);
    send(run, 3, 5);
    run.run(5.1);
    EXPECT_EQ(run.quality().stops, 1U);
    EXPECT_EQ(run.quality().returns, 1U);
    EXPECT_NEAR(static_cast<double>(run.counters().held), 900, 2);
    const std::vector<Left> some = within(run, 2.25, 3.05);
    EXPECT_EQ(some.empty(), reaction == "silence");
    for (const Left& left : some) ASSERT_EQ(left.sample.status, 0U);
  }
}

// The simulator's user pauses it for 3 s: its time continues where it stopped.
TEST_F(RealtimeRun, AfterAPauseTheRunGoesOn) {
  SimulatedRun run(config(1000, "delay_ms = 20"));
  send(run, 0, 2);
  send(run, 2.01, 6, 3);
  run.run(9.1);
  expect_grid(run.left(), Grid(1000), run.at(0.12), 20us);
  EXPECT_EQ(run.quality().resumed, 1U);
  EXPECT_EQ(run.quality().caught_up, 0U) << "it stays late";
  EXPECT_EQ(run.truth_counters().runs, 1U) << "its time never went back";
  expect_truth(run, 5.4, 9.1, -3.12);
}

TEST_F(RealtimeRun, AfterALeapTheRunGoesOn) {
  SimulatedRun run(config(1000, "delay_ms = 20\nmax_gap_ms = 60000"));
  send(run, 0, 2);
  send(run, 12, 14, -9.99);
  run.run(4);
  expect_grid(run.left(), Grid(1000), run.at(0.12), 20us);
  EXPECT_EQ(run.quality().resumed, 1U);
  EXPECT_EQ(run.quality().caught_up, 0U);
  EXPECT_EQ(run.quality().leaps, 1U);
  EXPECT_EQ(run.truth_counters().runs, 1U);
  expect_truth(run, 2.2, 4, 9.87);
}

// With the flag, and without it after twenty truths in a row.
TEST_F(RealtimeRun, ASimulatorThatRestartsBeginsANewRun) {
  for (const bool flag : {true, false}) {
    SimulatedRun run(config(1000, "delay_ms = 20"));
    send(run, 10, 12);
    send(run, 0, 3, 12.5, flag);
    run.run(15.5);
    expect_grid(run.left(), Grid(1000), run.at(10.12), 20us);
    EXPECT_EQ(run.truth_counters().runs, 2U) << flag;
    EXPECT_EQ(run.quality().resumed, 0U);
    expect_truth(run, 13, 15.5, -12.62);
  }
}

// Samples of the time in which the host was stopped are sent immediately afterwards; none is left out, and they use
// the truth that had arrived.
TEST_F(RealtimeRun, AHoldUpOfTheHostMissesNoSample) {
  SimulatedRun run(config(1000, "delay_ms = 20"));
  send(run, 0, 3);
  run.host().freeze(run.at(1.5), run.at(1.8));
  run.run(3.1);
  ASSERT_GT(run.left().size(), 2900U);
  for (std::size_t k = 0; k < run.left().size(); ++k) ASSERT_EQ(run.left()[k].sample.counter, k);
  EXPECT_EQ(run.counters().extrapolated, 0U);
  // Samples of 1.5 s to 1.8 s: all but the last one were a whole period late, or more.
  std::size_t late = 0;
  for (const Left& left : run.left())
    late += left.time - (run.at(0.12) + Grid(1000).offset(left.sample.counter)) >= 1ms;
  EXPECT_GT(late, 295U);
  EXPECT_EQ(run.counters().missed, late);
  EXPECT_NEAR(run.counters().lateness.max(), 0.3, 0.01);
  for (const auto& r : navigate(run.left(), 0)) {
    ASSERT_NEAR(r.angle, Swing::angle(r.time_s), Swing::angle_between(0.01) + 1e-9);
    ASSERT_NEAR(r.time_s, 1e-3 * static_cast<double>(r.sample.counter), 1e-6);
  }
}

// While the map of the simulator's clock is still being slewed to the estimate.
TEST_F(RealtimeRun, AfterAHoldUpTheSampledTimeGoesOnEvenly) {
  struct Case {
    double rate, jitter_s, held_up_s, imu_hz;
  };
  for (const Case& c : {Case{0.9, 0, 0.3, 1000}, Case{0.9, 0, 0.02, 4000}, Case{1.1, 0, 0.3, 1000},
                        Case{1, 0.005, 0.3, 1000}, Case{1, 0.005, 0.05, 200}}) {
    SimulatedRun run(config(c.imu_hz, "delay_ms = 40"));
    std::mt19937_64 random(5);
    std::uniform_real_distribution<double> jitter(0, std::max(c.jitter_s, 1e-9));
    for (int k = 0; k <= 300; ++k)
      run.truth(0.1 + 0.01 * k / c.rate + (k == 0 ? 0 : jitter(random)), Swing::truth(at_s(0.01 * k)));
    run.host().freeze(run.at(1.1), run.at(1.1 + c.held_up_s));
    run.run(2.7);
    double before_s = 0;
    ASSERT_GT(run.left().size(), static_cast<std::size_t>(2.5 * c.imu_hz));
    for (const auto& r : navigate(run.left(), 0)) {
      ASSERT_EQ(r.sample.status, 0U) << r.time_s;
      if (r.time_s > 0.5) {
        ASSERT_NEAR((r.time_s - before_s) * c.imu_hz / c.rate, 1, 0.16) << r.time_s;
      }
      before_s = r.time_s;
    }
  }
}

// More truths between two samples than the timeline keeps.
TEST_F(RealtimeRun, ASlowSensorUsesFastTruth) {
  for (const auto& [imu_hz, truth_hz] : {std::pair{0.5, 1000.0}, {0.1, 200.0}, {1.0, 2000.0}}) {
    SimulatedRun run(config(imu_hz, "delay_ms = 50"));
    for (int k = 0; k <= 8 / imu_hz * truth_hz; ++k) {
      Truth truth = Swing::truth(at_s(k / truth_hz));
      truth.sequence = static_cast<std::uint32_t>(k);
      run.truth(0.1 + k / truth_hz, truth);
    }
    run.run(0.1 + 8 / imu_hz);
    ASSERT_EQ(run.left().size(), 8U);
    EXPECT_EQ(run.counters().extrapolated, 0U);
    EXPECT_EQ(run.truth_counters().lost, 0U);
    for (const auto& r : navigate(run.left(), 0)) EXPECT_NEAR(r.angle, Swing::angle(r.time_s), 1e-9) << imu_hz;
  }
}

// Truth rates and delays that resemble a pause, but are none.
TEST_F(RealtimeRun, LateTruthIsNoPause) {
  struct Case {
    double truth_hz, jitter_s;
    const char* keys;
  };
  for (const Case& c : {Case{100, 0, "extrapolate_ms = 0"}, Case{100, 0.03, "extrapolate_ms = 0"}, Case{5, 0.2, ""},
                        Case{2, 0.2, ""}, Case{1, 0, ""}}) {
    SimulatedRun run(config(200, c.keys));
    std::mt19937_64 random(9);
    std::uniform_real_distribution<double> jitter(0, c.jitter_s + 1e-9);
    for (int k = 0; k <= 60 * c.truth_hz; ++k) {
      Truth truth = Swing::truth(at_s(k / c.truth_hz));
      truth.sequence = static_cast<std::uint32_t>(k);
      run.truth(0.1 + k / c.truth_hz + jitter(random), truth);
    }
    run.run(60);
    EXPECT_GT(run.left().size(), 11'700U);
    EXPECT_EQ(run.quality().resumed, 0U) << c.truth_hz << " Hz, " << c.jitter_s << " s " << c.keys;
  }
}

// Between the return of truth and the time, one delay later, at which the sensor samples it.
TEST_F(RealtimeRun, AStoppedSensorIsStoppedUntilItMovesAgain) {
  for (const std::string reaction : {"flag", "silence"}) {
    SimulatedRun run(config(1000, "delay_ms = 500\nwhen_stopped = \"" + reaction + "\""));
    send(run, 0, 2);
    send(run, 2.01, 6, 3);
    run.run(9.1);
    EXPECT_EQ(run.quality().resumed, 1U);
    EXPECT_EQ(run.quality().stops, 1U);
    EXPECT_EQ(run.quality().returns, 1U);
    std::size_t flagged = 0;
    for (const Left& left : within(run, 1, 9.1)) {
      const bool is_held = (left.sample.status & status::truth_stale) != 0;
      ASSERT_EQ((left.sample.status & status::not_valid) != 0, is_held) << run.since_begin(left.time);
      flagged += is_held;
    }
    EXPECT_EQ(flagged > 2900, reaction == "flag");
  }
}

TEST_F(RealtimeRun, SixteenImusKeepSixteenGrids) {
  std::string text = "clock = \"realtime\"\n[truth]\nport = \"udp:127.0.0.1:9810\"\ndelay_ms = 20\n";
  const auto rate = [](std::size_t i) {
    return i % 4 == 0 ? 1000.0 : i % 4 == 1 ? 409.6 : i % 4 == 2 ? 2000.0 : 0.5;
  };
  const auto error = [](std::size_t i) { return i % 3 == 0 ? 0.0 : 100.0 * (static_cast<double>(i) - 8); };
  for (std::size_t i = 0; i < 16; ++i)
    text += fmt::format(
        "[[imu]]\nname = \"i{0}\"\nport = \"file:{0}\"\nprotocol = \"native\"\nrate_hz = {1}\n"
        "clock_error_ppm = {2}\nphase_us = {3}\ngyro.max_rad_per_s = 100\n"
        "accelerometer.max_m_per_s2 = 1000\n",
        i, rate(i), error(i), 37.5 * static_cast<double>(i));
  SimulatedRun run(load_config(write("config.toml", text)));
  send(run, 0, 10);
  run.run(10.1);
  for (std::size_t i = 0; i < 16; ++i) {
    const Grid grid(rate(i), error(i), nanoseconds(37.5e-6 * static_cast<double>(i)));
    expect_grid(run.left(i), grid, run.at(0.12), 20us);
    EXPECT_NEAR(static_cast<double>(run.left(i).size()), 9.98 * rate(i) * (1 + 1e-6 * error(i)), 2);
    EXPECT_EQ(run.counters(i).extrapolated, 0U);
    EXPECT_EQ(run.counters(i).missed, 0U);
  }
  // All imus sample the same motion, each at its own instants.
  for (const std::size_t i : {0U, 5U, 15U})
    for (const Left& left : run.left(i))
      ASSERT_NEAR(left.sample.rate.z(), Swing::truth(at_s(run.since_begin(left.time) - 0.12)).omega_BN_B.z(), 1e-3)
          << i;
}

// A host that sends without pause; 256 bytes of its data take the device 200 us.
TEST_F(RealtimeRun, AFloodFromTheHostDelaysNoSample) {
  class Flood final : public Port {
   public:
    explicit Flood(SimulatedHost& host) : host_(host) {}
    void send(std::span<const Frame> frames) noexcept override { counters_.count_sent(is_reply_, frames.size()); }
    std::optional<Received> receive() noexcept override {
      host_.spend(200us);
      return Received{{bytes_}, host_.now()};
    }

   private:
    SimulatedHost& host_;
    std::array<std::byte, 256> bytes_{};
  };
  SimulatedRun run(config(1000, "delay_ms = 20"));
  run.make_sensor = [](SimulatedHost& host) { return std::make_unique<Flood>(host); };
  send(run, 0, 3);
  run.run(3);
  EXPECT_GT(run.counters().samples, 2800U);
  EXPECT_EQ(run.counters().missed, 0U);
  EXPECT_LT(run.counters().lateness.max(), 250e-6) << "one look";
}

}  // namespace
}  // namespace imud
