// Samples that are taken before their truth has come: by how much extrapolation was wrong, and the truth that those
// who watch get; on a simulated clock.
#include <algorithm>
#include <cmath>

#include "emulator/engine/run_control.hpp"
#include "tests/emulator/run/realtime_test.hpp"

namespace imud {
namespace {

class AwaitedTruthTest : public RealtimeTest {
 protected:
  static void send(SimulatedRun& run, double from_s, double until_s) {
    for (int k = static_cast<int>(std::lround(100 * from_s)); k <= std::lround(100 * until_s); ++k)
      run.truth(0.1 + 0.01 * k, Swing::truth(at_s(0.01 * k)));
  }
};

// The motion is extrapolated with constant angular acceleration and specific force, by 1 to 10 ms: a sample at the
// arrival of a truth is prepared before it.
TEST_F(AwaitedTruthTest, MeasuresTheErrorOfExtrapolation) {
  SimulatedRun run(config(1000, "delay_ms = 0"));
  send(run, 0, 3);
  run.run(3.1);
  double rate = 0, force = 0;
  for (int k = 0; k < 300; ++k)
    for (int i = 1; i <= 10; ++i) {
      const double h = 1e-3 * i;
      const Truth last = Swing::truth(at_s(0.01 * k)), now = Swing::truth(at_s(0.01 * k + h));
      rate = std::max(rate, (now.omega_BN_B - last.omega_BN_B - h * last.omegaDot_BN_B).norm());
      force = std::max(force, (now.specific_force_B - last.specific_force_B).norm());
    }
  ASSERT_GT(rate, 0.005);
  ASSERT_GT(force, 0.1);
  const auto& error = run.quality().extrapolation_error;
  EXPECT_NEAR(error.rate_rad_per_s, rate, 0.01 * rate);
  EXPECT_NEAR(error.specific_force_m_per_s2, force, 0.02 * force);
  EXPECT_NEAR(error.ahead_s, 0.01, 20e-6);
  EXPECT_NEAR(static_cast<double>(error.samples), static_cast<double>(run.counters().extrapolated), 12);
  EXPECT_GT(error.samples, 2900U);
}

// A sensor off the origin, turned, beside the one at it.
TEST_F(AwaitedTruthTest, MeasuresItAtTheSensorsPlace) {
  SimulatedRun at_origin(config(1000, "delay_ms = 0"));
  SimulatedRun aside(
      config(1000, "delay_ms = 0", "mounting.position_m = [10, 0, 0]\nmounting.yaw_pitch_roll_deg = [40, 50, 60]"));
  for (SimulatedRun* run : {&at_origin, &aside}) {
    send(*run, 0, 2);
    run->run(2.1);
  }
  const auto &one = at_origin.quality().extrapolation_error, &other = aside.quality().extrapolation_error;
  EXPECT_NEAR(one.rate_rad_per_s, other.rate_rad_per_s, 1e-9);
  // The error of the angular acceleration, 10 ms of its change of 124 rad/s^3, acts on the lever of 10 m.
  EXPECT_GT(other.specific_force_m_per_s2, one.specific_force_m_per_s2 + 5);
}

TEST_F(AwaitedTruthTest, WithEnoughDelayThereIsNothingToMeasure) {
  SimulatedRun run(config(1000, "delay_ms = 20"));
  send(run, 0, 2);
  run.run(2.1);
  EXPECT_EQ(run.quality().extrapolation_error.samples, 0U);
  EXPECT_EQ(run.quality().extrapolation_error.rate_rad_per_s, 0.0);
}

// Truth is missing from 1 s to 1.3 s, and from 2 s on.
TEST_F(AwaitedTruthTest, ThoseWhoWatchGetTheTruthOfTheInstant) {
  const Config configured = config(1000, "delay_ms = 0\nextrapolate_ms = 50");
  RunControl control(1);
  control.feed.watch(0, 2);
  SimulatedRun run(configured);
  run.control = &control;
  send(run, 0, 1);
  send(run, 1.3, 2);
  run.run(2.9);
  std::vector<FeedSample> all;
  for (FeedSample sample; control.feed.pop(sample);) all.push_back(sample);
  ASSERT_GT(all.size(), 1100U);
  std::size_t extrapolated = 0, in_gap = 0, unknown = 0;
  for (std::size_t i = 0; i < all.size(); ++i) {
    ASSERT_EQ(all[i].k, 2 * i) << "each second one, in order";
    const double t = 1e-9 * static_cast<double>(all[i].time_ns);
    // Both samples since the one before count, though only one of them is shown.
    if ((t > 1.06 && t < 1.3) || t > 2.06) {
      ASSERT_EQ(all[i].held - all[i - 1].held, 2U) << t;
    }
    if (t < 1) {
      ASSERT_EQ(all[i].held, 0U) << t;
    }
    if (t > 2 - 1e-6 && t < 2 + 1e-6) continue;  // at the newest truth, by the last correction of the clock
    if (t > 2) {
      ASSERT_TRUE(std::isnan(all[i].true_rate.z())) << t;
      ASSERT_TRUE(std::isnan(all[i].true_specific_force.x())) << t;
      ++unknown;
      continue;
    }
    const bool is_in_gap = t > 1 && t < 1.301;  // the sample at 1.3 s was taken before its truth came
    // Simulation time stands still 50 ms after the newest truth.
    const Truth truth = Swing::truth(at_s(is_in_gap ? std::min(t, 1.05) : t));
    ASSERT_NEAR(all[i].true_rate.z(), truth.omega_BN_B.z(), is_in_gap ? 0.2 : 1e-5) << t;
    ASSERT_LT((all[i].true_specific_force - truth.specific_force_B).norm(), is_in_gap ? 1.0 : 1e-3) << t;
    in_gap += is_in_gap;
    extrapolated += !is_in_gap && (all[i].status & status::truth_extrapolated) != 0;
  }
  EXPECT_GT(extrapolated, 800U);
  EXPECT_GT(in_gap, 140U);
  EXPECT_GT(unknown, 100U) << "half a second later";
}

}  // namespace
}  // namespace imud
