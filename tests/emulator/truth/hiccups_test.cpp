// A simulator that stands still for a while is weather: scenario, labels, counter and increments go on. On a
// simulated clock; the bytes that were sent are decoded and read without the labels.
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "emulator/config/scenario.hpp"
#include "emulator/faults/fault_labels.hpp"
#include "tests/emulator/run/realtime_test.hpp"

namespace imud {
namespace {

using namespace std::chrono_literals;

constexpr double at_once = std::numeric_limits<double>::infinity();
constexpr double never = 1;  // the rate at which a simulator catches up

struct Hiccup {
  double at_s = 0;      // of simulation
  double for_s = 0;     // of the host's clock
  double rate = never;  // simulation seconds per host second until it has caught up
};

class Hiccups : public RealtimeTest {
 protected:
  static constexpr double rate_hz = 200, period_s = 1 / rate_hz, step_s = 0.01, begin_s = 0.1;

  // Sends truths from 0 to `until_s`, and returns when the last one arrives, s since the simulation's start.
  static double send(SimulatedRun& run, double until_s, const std::vector<Hiccup>& hiccups) {
    double late_s = 0, rate = never, arrival_s = 0;
    for (int k = 0; k <= std::lround(until_s / step_s); ++k) {
      const double t = step_s * k;
      for (const Hiccup& hiccup : hiccups)
        if (std::lround(hiccup.at_s / step_s) == k) {
          late_s += hiccup.for_s;
          rate = hiccup.rate;
        }
      arrival_s = begin_s + t + late_s;
      run.truth(arrival_s, Swing::truth(at_s(t)));
      late_s = std::max(0.0, late_s - (1 - 1 / rate) * step_s);
    }
    return arrival_s;
  }

  // A bias of 1 rad/s about x, about which the vehicle does not turn, from 1 s to 1.5 s.
  static std::string bias(const std::string& times = "at_s = 1\nfor_s = 0.5\n") {
    return "\n[[fault]]\nname = \"off\"\ntarget = \"gyro.x\"\nkind = \"bias\"\nvalue = 1\n" + times;
  }

  static std::vector<FaultLabel> labels(SimulatedRun& run) {
    run.engine().finish_faults();
    return fault_labels(run.engine().faults().all(), std::vector<std::string>{"i0"}, run.engine().faults().log());
  }

  // The samples on which the fault has acted, by their rates alone: pairs of first and last counter.
  static std::vector<std::pair<std::uint64_t, std::uint64_t>> seen(const std::vector<Left>& left) {
    std::vector<std::pair<std::uint64_t, std::uint64_t>> all;
    for (const Left& one : left) {
      const double x = one.sample.rate.x();
      EXPECT_TRUE(std::abs(x) < 1e-9 || std::abs(x - 1) < 1e-9) << x;
      if (x < 0.5) continue;
      if (all.empty() || all.back().second + 1 != one.sample.counter)
        all.emplace_back(one.sample.counter, one.sample.counter);
      all.back().second = one.sample.counter;
    }
    return all;
  }

  // Expects a sample of each period, and that the sum of all increments is the vehicle's rotation: with the rate it
  // gives a point on the swing's circle, and by its phase the time, which never decreases. Returns the times since
  // the first truth, of the samples that are not flagged; nullopt: it is flagged.
  static std::vector<std::optional<double>> times(const std::vector<Left>& left) {
    std::vector<std::optional<double>> all;
    double angle = 0, before_s = 0;
    std::size_t k = 0;
    for (const Left& one : left) {
      EXPECT_EQ(one.sample.counter, k);
      EXPECT_EQ(one.sample.time.ns - left[0].sample.time.ns, Grid(rate_hz).nominal_offset(k).count());
      ++k;
      angle += one.sample.delta_angle.z();
      all.emplace_back();
      if (one.sample.status != 0) continue;
      const double sine = angle / Swing::amplitude,
                   cosine = one.sample.rate.z() / (Swing::amplitude * Swing::frequency);
      EXPECT_NEAR(std::hypot(sine, cosine), 1, 1e-3) << "sample " << one.sample.counter;
      double s = std::atan2(sine, cosine) / Swing::frequency;
      s += std::round(before_s + 0.5 - s) - (std::round(before_s + 0.5 - s) > before_s + 0.5 - s ? 1 : 0);
      if (s < before_s - 1e-4) s += 1;   // the phase has gone on to the next swing
      if (s > before_s + 0.999) s -= 1;  // by the rounding of numbers
      EXPECT_GE(s, before_s - 1e-4) << "sample " << one.sample.counter;
      all.back() = before_s = s;
    }
    return all;
  }

  std::vector<ImuConfig> imus_;
};

constexpr double lengths_s[] = {0.05, 0.1, 0.2, 0.3, 0.5, 0.7, 1, 2, 3, 5};
constexpr double rates[] = {at_once, 1.2, never};

TEST_F(Hiccups, AScenarioActsOnceWhateverTheLength) {
  for (const double at : {0.5, 1.2, 2.0})  // before, within and after the window of the fault
    for (const double rate : rates)
      for (const double length : lengths_s) {
        SCOPED_TRACE(fmt::format("{} s at {} s, then at {}", length, at, rate));
        SimulatedRun run(config(rate_hz, "delay_ms = 20", bias()));
        const double end_s = send(run, 6, {{at, length, rate}});
        run.run(end_s);
        ASSERT_GT(static_cast<double>(run.left().size()), rate_hz * (end_s - 0.2));
        EXPECT_EQ(run.truth_counters().runs, 1U);

        const std::vector<FaultLabel> all = labels(run);
        ASSERT_EQ(all.size(), 1U);
        EXPECT_EQ(all[0].first.occurrence, 0U);
        EXPECT_EQ(all[0].first.run, 0);
        const auto acted = seen(run.left());
        const auto reached = times(run.left());
        if (HasFailure()) return;
        // The phase loses whole swings where samples are flagged for long.
        const auto expect_time = [&](std::optional<double> s, double time_s, double tolerance) {
          if (s) {
            EXPECT_NEAR(std::remainder(*s - time_s, 1), 0, tolerance);
          }
        };
        if (rate == at_once && at + 0.1 < 1 && at + length > 1.6) {
          EXPECT_EQ(all[0].state, FaultLabel::State::passed_over);
          EXPECT_TRUE(acted.empty());
        } else {
          EXPECT_EQ(all[0].state, FaultLabel::State::acted);
          EXPECT_GE(all[0].first.time_s, 1);
          EXPECT_LE(all[0].last.time_s, 1.5);
          ASSERT_EQ(acted.size(), 1U);
          // The run may end between the last sample and its instant.
          const std::uint64_t last_sent = run.left().back().sample.counter;
          EXPECT_EQ(acted[0], std::pair(all[0].first.counter, std::min(all[0].last.counter, last_sent)));
          expect_time(reached[acted[0].first], all[0].first.time_s, 1e-3);
          expect_time(reached[acted[0].second], all[0].last.time_s, 1e-3);
        }
        // What was lost is not slewed for seconds: soon after the pause samples are those of the newest truths. Where
        // the simulator's rate changes twice, its estimate takes longer, and samples are extrapolated, but not held.
        const double again_s = begin_s + at + length + (length > 0.1 ? 1 : 2.5);
        std::size_t good = 0, late = 0;
        for (const Left& left : run.left())
          if (run.since_begin(left.time) >= again_s)
            ++((left.sample.status & (rate == 1.2 ? status::truth_stale : ~0U)) == 0 ? good : late);
        if (again_s + 0.5 < end_s) {
          EXPECT_GT(good, 5 * late);
        }
        const double last_s = run.since_begin(run.left().back().time);
        expect_time(reached.back(), 6 - (end_s - last_s) - 0.02, 0.12);
        if (HasFailure()) return;
      }
}

TEST_F(Hiccups, TwoAreNoMoreThanOne) {
  for (const double rate : rates)
    for (const double apart : {0.15, 0.3, 0.6}) {
      SCOPED_TRACE(fmt::format("{} s apart, then at {}", apart, rate));
      SimulatedRun run(config(rate_hz, "delay_ms = 20", bias()));
      const double end_s = send(run, 6, {{0.8, 0.4, rate}, {0.8 + apart, 0.4, rate}});
      run.run(end_s);
      EXPECT_EQ(run.truth_counters().runs, 1U);
      const std::vector<FaultLabel> all = labels(run);
      ASSERT_EQ(all.size(), 1U);
      const auto acted = seen(run.left());
      if (all[0].state == FaultLabel::State::passed_over) {
        EXPECT_EQ(rate, at_once);
        EXPECT_TRUE(acted.empty());
      } else {
        ASSERT_EQ(acted.size(), 1U);
        EXPECT_EQ(acted[0], std::pair(all[0].first.counter, all[0].last.counter));
      }
      if (const auto last = times(run.left()).back()) {
        const double last_s = 6 - (end_s - run.since_begin(run.left().back().time)) - 0.02;
        EXPECT_NEAR(std::remainder(*last - last_s, 1), 0, 0.12);
      }
    }
}

// The simulator's time leaps by 3 s: no motion lies between, and so no increment; the sample after it is flagged.
TEST_F(Hiccups, ALeapPassesOverWhatLiesWithinIt) {
  SimulatedRun run(config(rate_hz, "delay_ms = 20",
                          bias("at_s = 2.5\nfor_s = 1\n") +
                              "[[fault]]\nname = \"later\"\ntarget = \"gyro.x\"\nkind = \"bias\"\nvalue = 1\n"
                              "at_s = 6\nfor_s = 0.5\n"));
  for (int k = 0; k <= 600; ++k) run.truth(begin_s + step_s * k, Swing::truth(at_s(step_s * k + (k > 200 ? 3 : 0))));
  run.run(6);
  EXPECT_EQ(run.truth_counters().runs, 1U);
  EXPECT_EQ(run.quality().leaps, 1U);
  EXPECT_EQ(run.quality().resumed, 1U);
  const std::vector<FaultLabel> all = labels(run);
  ASSERT_EQ(all.size(), 2U);
  EXPECT_EQ(all[0].fault->name, "off");
  EXPECT_EQ(all[0].state, FaultLabel::State::passed_over);
  EXPECT_EQ(all[1].fault->name, "later");
  EXPECT_NEAR(all[1].first.time_s, 6, 0.006);
  const auto acted = seen(run.left());
  ASSERT_EQ(acted.size(), 1U);
  EXPECT_EQ(acted[0], std::pair(all[1].first.counter, all[1].last.counter));
  std::size_t flagged = 0;
  for (const Left& left : run.left()) {
    EXPECT_LT(left.sample.delta_velocity.norm(), 2 * period_s * 12);
    flagged += left.sample.status != 0;
  }
  EXPECT_GT(flagged, 0U);
  EXPECT_LT(flagged, 30U);
  const std::vector<FaultOutcome> outcomes = fault_outcomes(run.engine().faults().configured(), all);
  ASSERT_EQ(outcomes.size(), 2U);
  EXPECT_FALSE(outcomes[0].has_begun());
  EXPECT_TRUE(outcomes[0].is_passed_over);
  EXPECT_EQ(outcomes[1].occurrences, 1U);
}

// Only a simulator that starts again begins the scenario anew; the labels tell the runs apart.
TEST_F(Hiccups, ASimulatorThatStartsAgainBeginsTheScenarioAgain) {
  SimulatedRun run(config(rate_hz, "delay_ms = 20", bias()));
  for (int k = 0; k <= 300; ++k) run.truth(begin_s + step_s * k, Swing::truth(at_s(step_s * k)));
  for (int k = 0; k <= 300; ++k) {
    Truth truth = Swing::truth(at_s(step_s * k));
    truth.new_run = k == 0;
    run.truth(4 + step_s * k, truth);
  }
  run.run(7);
  EXPECT_EQ(run.truth_counters().runs, 2U);
  const std::vector<FaultLabel> all = labels(run);
  ASSERT_EQ(all.size(), 2U);
  for (int i = 0; i < 2; ++i) {
    EXPECT_EQ(all[static_cast<std::size_t>(i)].first.run, i);
    EXPECT_EQ(all[static_cast<std::size_t>(i)].first.occurrence, 0U);
    EXPECT_NEAR(all[static_cast<std::size_t>(i)].first.time_s, 1, 0.006);
  }
  EXPECT_EQ(seen(run.left()).size(), 2U);
}

// Begun before the first truth, with samples of a vehicle at rest or none: it acts from the next sample on, for its
// time, and on past the first truth.
TEST_F(Hiccups, AFaultThatBeginsBeforeTheFirstTruthActs) {
  for (const std::string before : {"rest", "silence"})
    for (const double for_s : {0.2, 2.0}) {
      SCOPED_TRACE(fmt::format("{} {}", before, for_s));
      SimulatedRun run(
          config(rate_hz, "delay_ms = 20", "before_first = \"" + before + "\"\n[control]\nfaults = true\n"));
      for (int k = 0; k <= 300; ++k) run.truth(1 + step_s * k, Swing::truth(at_s(step_s * k)));
      std::uint64_t next = 0;
      bool has_begun = false;
      run.host().on_wait = [&] {
        if (has_begun || run.host().now() < run.at(0.5)) return;
        has_begun = true;
        Engine& engine = run.engine();
        std::vector<std::string> wrong;
        const std::string text = fmt::format("target = \"gyro.x\"\nkind = \"bias\"\nvalue = 1\nfor_s = {}\n", for_s);
        const std::uint32_t number = engine.faults().add(read_begun_fault(text, 0, imus_, wrong), text);
        next = engine.channels()[0]->sensor.imu().next();
        engine.apply(Step::command({.kind = Command::Kind::fault_begin, .number = number}, HostTime{}));
      };
      imus_ = config(rate_hz, "").imus;
      run.run(3.5);
      const auto acted = seen(run.left());
      ASSERT_EQ(acted.size(), 1U);
      EXPECT_EQ(acted[0].first, next);
      EXPECT_NEAR(static_cast<double>(acted[0].second + 1 - next), rate_hz * for_s, 2);
      const std::vector<FaultLabel> all = labels(run);
      ASSERT_EQ(all.size(), 1U);
      EXPECT_EQ(acted[0], std::pair(all[0].first.counter, all[0].last.counter));
      EXPECT_EQ(all[0].first.run, before == "rest" ? -1 : 0);
      EXPECT_EQ(all[0].last.run, before == "rest" && for_s < 0.5 ? -1 : 0);
    }
}

}  // namespace
}  // namespace imud
