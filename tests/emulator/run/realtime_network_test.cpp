// The real-time loop with truth disturbed by networks and simulators, on a simulated clock.
#include "tests/emulator/run/realtime_test.hpp"

namespace imud {
namespace {

using namespace std::chrono_literals;

struct Network {
  double jitter_s = 0, lost = 0, repeated = 0, overtaken = 0;
  double rate = 1;  // simulation seconds per host second
};

class DisturbedTruth : public RealtimeTest {
 protected:
  // Truths every 10 ms from 0 to `until_s`. Remembers when each arrives.
  void send(SimulatedRun& run, double until_s, const Network& network, unsigned seed = 1) {
    std::mt19937_64 random(seed);
    std::uniform_real_distribution<double> uniform(0, 1);
    const int n = static_cast<int>(std::lround(until_s / step_s));
    for (int k = 0; k <= n; ++k) {
      const double t = step_s * k;
      double arrival = 0.1 + t / network.rate + network.jitter_s * (2 * uniform(random) - 1);
      if (uniform(random) < network.overtaken) arrival += 1.5 * step_s;
      const bool lost = uniform(random) < network.lost;
      const bool repeated = uniform(random) < network.repeated;
      if (k == 0) arrival = 0.1;
      if (lost && k > 0) continue;
      put(run, arrival, t);
      if (repeated) put(run, arrival + step_s * uniform(random), t);
    }
  }
  void put(SimulatedRun& run, double arrival_s, double t) {
    run.truth(arrival_s, Swing::truth(at_s(t)));
    const auto [at, fresh] = arrivals_.emplace(t, arrival_s);
    if (!fresh) at->second = std::min(at->second, arrival_s);
  }
  // The newest truth that has arrived by then, and the longest gap before it that is not yet filled.
  double newest(double host_s) const {
    double t = 0;
    for (const auto& [time, arrival] : arrivals_)
      if (arrival <= host_s) t = std::max(t, time);
    return t;
  }

  static constexpr double step_s = 0.01;
  std::map<double, double> arrivals_;  // by truth time
};

constexpr Network bad = {.jitter_s = 0.005, .lost = 0.05, .repeated = 0.01, .overtaken = 0.01};

TEST_F(DisturbedTruth, WithoutDelayTheSumsFollowAndReturn) {
  for (const std::string angle : {"rotation_vector", "integral"}) {
    arrivals_.clear();
    SimulatedRun run(config(1000, "", "increments.delta_angle = \"" + angle + "\""));
    send(run, 10, bad);
    // Then all missing truths arrive at once: the stream is complete.
    for (int k = 1; k <= 20; ++k) put(run, 10.11, 10 + step_s * k);
    run.run(10.2);
    ASSERT_GT(run.left().size(), 10'050U);
    expect_grid(run.left(), Grid(1000), run.at(0.1), 20us);
    EXPECT_GT(run.truth_counters().lost, 20U);
    EXPECT_GT(run.truth_counters().refused[static_cast<std::size_t>(Refusal::duplicate)], 2U);
    EXPECT_EQ(run.quality().resumed, 0U);
    EXPECT_EQ(run.counters().held, 0U);

    Timeline undisturbed;
    for (int k = 900; k <= 1020; ++k) undisturbed.push(Swing::truth(at_s(step_s * k)));
    std::size_t whole = 0, extrapolated = 0;
    for (const Reached& r : navigate(run.left(), 0)) {
      const double host_s = run.since_begin(r.host);
      const double angle_error = std::abs(r.angle - Swing::angle(r.time_s));
      const double dv_error = (r.dv_N - Swing::dv_N(r.time_s)).norm();
      if (host_s > 10.115 && (r.sample.status & status::truth_extrapolated) == 0) {
        ++whole;
        const MotionState state = undisturbed.at(at_s(r.time_s));
        ASSERT_NEAR(r.angle, log(state.q_NB).z(), 1e-9) << host_s;
        ASSERT_LT((r.dv_N - Swing::dv_N(9) - state.dv_N).norm(), 1e-9) << host_s;
        continue;
      }
      // Frames are prepared 150 us before they are sent.
      const double h = std::max(step_s, r.time_s - newest(host_s - 150e-6 - 20e-6));
      extrapolated += (r.sample.status & status::truth_extrapolated) != 0;
      ASSERT_LT(angle_error, Swing::angle_error(h)) << host_s;
      ASSERT_LT(dv_error, Swing::dv_error(h)) << host_s;
    }
    EXPECT_GT(whole, 50U);
    EXPECT_GT(extrapolated, 9000U);
  }
}

TEST_F(DisturbedTruth, WithEnoughDelayItIsTheUndisturbedStream) {
  Network without_loss = bad;
  without_loss.lost = 0;
  for (const double rate_hz : {1000.0, 200.0, 50.0, 10.0}) {
    arrivals_.clear();
    SimulatedRun run(config(rate_hz, "delay_ms = 35"));
    send(run, 10, without_loss);
    run.run(10.1);
    ASSERT_GT(run.left().size(), static_cast<std::size_t>(9.9 * rate_hz));
    expect_grid(run.left(), Grid(rate_hz), run.at(0.135), 20us);
    EXPECT_EQ(run.counters().extrapolated, 0U);
    EXPECT_GT(run.truth_counters().inserted, 3U);
    EXPECT_EQ(run.truth_counters().lost, 0U);

    // The model on the same truths in order, at the same instants.
    Timeline timeline;
    for (int k = 0; k <= 1000; ++k) timeline.push(Swing::truth(at_s(step_s * k)));
    for (const Reached& r : navigate(run.left(), 0)) {
      const MotionState state = timeline.at(at_s(r.time_s));
      ASSERT_NEAR(r.angle, log(state.q_NB).z(), 1e-9) << r.time_s;
      ASSERT_NEAR(r.sample.rate.z(), state.omega_BN_B.z(), 1e-9) << r.time_s;
      ASSERT_LT((r.sample.specific_force - state.specific_force_B).norm(), 1e-9) << r.time_s;
      ASSERT_LT((r.dv_N - state.dv_N).norm(), 1e-9) << r.time_s;
    }
  }
}

TEST_F(DisturbedTruth, WithEnoughDelayOnlyTheLostAreMissed) {
  SimulatedRun run(config(1000, "delay_ms = 60"));
  send(run, 10, bad);
  run.run(10.1);
  ASSERT_GT(run.left().size(), 9900U);
  EXPECT_LT(run.counters().extrapolated, 20U);  // three in a row lost
  for (const Reached& r : navigate(run.left(), 0))
    ASSERT_NEAR(r.angle, Swing::angle(r.time_s), Swing::angle_between(4 * step_s)) << r.time_s;
}

TEST_F(DisturbedTruth, AnUndisturbedOneIsSampledExactlyAtItsOwnTime) {
  SimulatedRun run(config(1000, "delay_ms = 20"));
  send(run, 5, {});
  run.run(5);
  ASSERT_GT(run.left().size(), 4800U);
  for (const Reached& r : navigate(run.left(), 0))
    ASSERT_NEAR(r.time_s, run.since_begin(r.host) - 0.12, 20e-6) << r.time_s;
}

TEST_F(DisturbedTruth, ASimulatorAtAnotherRateIsFollowed) {
  for (const double rate : {0.9, 1.1, 0.97, 1.003, 0.5, 2.0, 0.2, 2.2, 3.0, 5.0, 8.0}) {
    arrivals_.clear();
    SimulatedRun run(config(1000, "delay_ms = 40"));
    send(run, 20 * rate, {.jitter_s = 0.002, .rate = rate});
    run.run(20);
    expect_grid(run.left(), Grid(1000), run.at(0.14), 20us);
    EXPECT_NEAR(run.quality().rate, rate, 2e-3 * rate);
    EXPECT_LE(run.quality().resumed, rate < 0.7 ? 1U : rate > 1.5 ? 2U : 0U) << rate;
    // At the start, until the simulator reaches the time up to which motion was extrapolated at a rate of 1.
    EXPECT_LT(run.counters().held, rate < 0.3 ? 800U : 500U) << rate;
    if (run.quality().resumed > 0) continue;
    double before = 0;
    for (const Reached& r : navigate(run.left(), 0)) {
      const double host_s = run.since_begin(r.host);
      ASSERT_LE(before, r.time_s + 1e-12) << "never steps back";
      ASSERT_LT(r.time_s - before, 1e-3 * std::max(rate, 1 / rate) * 1.06) << "nor leaps";
      before = r.time_s;
      if (host_s > 12) {
        ASSERT_EQ(r.sample.status, 0U) << host_s;
        ASSERT_NEAR(r.angle, Swing::angle(r.time_s), 1e-6);
        ASSERT_NEAR(r.time_s, (host_s - 0.1) * rate - 0.04, 0.01) << rate;
      }
    }
  }
}

// The arrivals of 42's truth over a network as it was recorded: see tests/captures/README.md.
TEST_F(DisturbedTruth, TheSlowClockOf42) {
  std::ifstream file(IMUD_TEST_DATA "/captures/sim42_arrivals_us.txt");
  std::vector<double> times;
  for (double us = 0; file >> us;) times.push_back(1e-6 * us);
  ASSERT_EQ(times.size(), 6001U);
  Timeline undisturbed;
  for (const std::string truth : {"", "delay_ms = 80", "delay_ms = \"auto\""}) {
    arrivals_.clear();
    SimulatedRun run(config(1000, truth));
    for (std::size_t k = 0; k < times.size(); ++k) put(run, 0.1 + times[k], step_s * static_cast<double>(k));
    run.run(66.8);
    const std::uint64_t extrapolated = run.counters().extrapolated;
    const bool automatic = truth.find("auto") != std::string::npos, enough = truth.find("80") != std::string::npos;
    ASSERT_GT(run.left().size(), automatic ? 65'500U : 66'500U);
    const HostTime begin = automatic ? run.left()[0].time : run.at(0.1 + (enough ? 0.08 : 0));
    expect_grid(run.left(), Grid(1000), begin, 20us);
    EXPECT_LT(run.since_begin(begin), 1.2);
    EXPECT_EQ(run.quality().resumed, 0U);
    EXPECT_EQ(run.counters().held, 0U);
    EXPECT_NEAR(run.quality().rate, 60 / 66.75, 0.05);
    if (enough) {
      EXPECT_EQ(extrapolated, 0U);
    }
    if (automatic) {
      EXPECT_LT(extrapolated, run.left().size() * 5 / 100);
    }
    if (truth.empty()) {
      EXPECT_GT(extrapolated, 40'000U);
    }
    auto at = arrivals_.begin();
    int k = 0;
    for (const Reached& r : navigate(run.left(), seconds(run.left()[0].sample.time - DeviceTime{}))) {
      const double host_s = run.since_begin(r.host) - 150e-6 - 20e-6;
      while (at != arrivals_.end() && at->second <= host_s) ++at;
      const double h = std::max(step_s, r.time_s - std::prev(at)->first);
      ASSERT_NEAR(r.angle, Swing::angle(r.time_s), Swing::angle_error(h)) << r.time_s;
      ASSERT_LT((r.dv_N - Swing::dv_N(r.time_s)).norm(), Swing::dv_error(h)) << r.time_s;
      if (!enough) continue;
      for (; step_s * k < r.time_s + 2 * step_s; ++k) undisturbed.push(Swing::truth(at_s(step_s * k)));
      const MotionState state = undisturbed.at(at_s(r.time_s));
      ASSERT_NEAR(r.angle, log(state.q_NB).z(), 1e-9) << r.time_s;
      ASSERT_LT((r.dv_N - state.dv_N).norm(), 1e-8) << r.time_s;
    }
  }
}

TEST_F(DisturbedTruth, AnAutomaticDelayIsEnough) {
  SimulatedRun run(config(1000, "delay_ms = \"auto\"\nauto_delay_percent = 95"));
  send(run, 60, {.jitter_s = 0.01});
  run.run(60);
  // 95 % of the lateness, uniform over 20 ms, and the interval before: 19 + 10 ms; and a quarter of the jitter.
  EXPECT_GT(run.quality().delay_s, 0.028);
  EXPECT_LT(run.quality().delay_s, 0.039);
  std::size_t extrapolated = 0;
  for (const Left& left : run.left()) extrapolated += left.sample.status != 0 && left.sample.counter > 20'000;
  EXPECT_LT(extrapolated, 40'000U / 20);
  expect_grid(run.left(), Grid(1000), run.left()[0].time, 20us);
}

TEST_F(DisturbedTruth, AFloodOfGarbageDelaysNoSample) {
  SimulatedRun run(config(1000, ""));
  send(run, 2, {});
  for (int i = 0; i < 400'000; ++i) run.garbage(0.5 + 2.5e-6 * i);  // as fast as they can be decoded
  run.run(2.1);
  expect_grid(run.left(), Grid(1000), run.at(0.1), 300us);
  EXPECT_EQ(run.counters().missed, 0U);
  EXPECT_GT(run.left().size(), 1990U);
}

}  // namespace
}  // namespace imud
