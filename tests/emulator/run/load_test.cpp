// Many sensors on one thread, by the simulated clock: how late samples are while the work fits, and beyond.
#include <algorithm>

#include "tests/emulator/run/realtime_test.hpp"

namespace imud {
namespace {

using namespace std::chrono_literals;

class LoadTest : public RealtimeTest {
 protected:
  struct Rack {
    std::string text;
    std::vector<Grid> grids;
    double rate = 0;  // samples per second of all
  };
  Rack rack(std::mt19937& random, std::size_t imus) const {
    Rack rack;
    rack.text = "clock = \"realtime\"\n[truth]\nport = \"udp:127.0.0.1:9810\"\ndelay_ms = 30\n";
    std::uniform_real_distribution<double> log_rate(std::log(50.0), std::log(4000.0)), unit(0, 1);
    for (std::size_t i = 0; i < imus; ++i) {
      const double rate = std::exp(log_rate(random)), phase_us = 1e6 / rate * unit(random);
      rack.text += fmt::format(
          "[[imu]]\nname = \"i{0}\"\nport = \"file:{0}\"\nprotocol = \"native\"\nrate_hz = {1:.6f}\n"
          "phase_us = {2:.3f}\ngyro.max_rad_per_s = 100\naccelerometer.max_m_per_s2 = 1000\n",
          i, rate, phase_us);
      rack.grids.emplace_back(rate, 0.0, nanoseconds(1e-6 * phase_us));
      rack.rate += rate;
    }
    return rack;
  }
  static void send(SimulatedRun& run, double until_s) {
    for (double t = 0; t < until_s; t += 0.01) run.truth(t, Swing::truth(at_s(t)));
  }
  // Returns the greatest lateness of the samples from then on. Each is on its grid, from the first that is sent.
  static Nanoseconds latest(const SimulatedRun& run, const std::vector<Grid>& grids, double from_s) {
    Nanoseconds latest{0};
    for (std::size_t i = 0; i < grids.size(); ++i)
      for (const Left& left : run.left(i)) {
        const Nanoseconds late = left.time - (run.at(0.03) + grids[i].offset(left.sample.counter));
        EXPECT_GE(late.count(), 0);
        if (left.time >= run.at(from_s)) latest = std::max(latest, late);
      }
    return latest;
  }
};

// Work of 70 % of the thread. If all samples were due at once, the last would leave after n times the cost; others
// that become due meanwhile take 70 % of the time until the thread has caught up.
TEST_F(LoadTest, WhileTheWorkFitsLatenessIsBounded) {
  std::mt19937 random(26);
  for (int round = 0; round < 12; ++round) {
    const std::size_t imus = 2 + random() % 31;
    const Rack rack = this->rack(random, imus);
    SCOPED_TRACE(rack.text);
    SimulatedRun run(load_config(write("config.toml", rack.text)));
    run.host().send_cost = nanoseconds(0.7 / rack.rate);
    send(run, 2);
    run.run(2);
    const Nanoseconds bound = static_cast<int>(imus) * run.host().send_cost * 10 / 3 + 100us;
    EXPECT_LT(latest(run, rack.grids, 0), bound);
    for (std::size_t i = 0; i < imus; ++i) {
      EXPECT_EQ(run.counters(i).extrapolated, 0U);
      EXPECT_EQ(run.counters(i).skipped, 0U);
    }
  }
}

// For two seconds each sample costs three times as much as there is time for.
TEST_F(LoadTest, BeyondSamplesAreSkippedAndTheLoopReturnsWithinASecond) {
  std::mt19937 random(27);
  Rack rack = this->rack(random, 16);
  rack.text.insert(rack.text.find("[truth]"), "[realtime]\nskip_after_ms = 200\n");
  SimulatedRun run(load_config(write("config.toml", rack.text)));
  const Nanoseconds fits = nanoseconds(0.5 / rack.rate);
  run.host().send_cost = fits;
  run.host().on_wait = [&] { run.host().send_cost = run.host().now() < run.at(1) ? fits : 6 * fits; };
  run.host().on_send = [&](HostTime now) {
    if (now >= run.at(3)) run.host().send_cost = fits;
  };
  send(run, 6);
  run.run(6);
  std::uint64_t skipped = 0, samples = 0;
  for (std::size_t i = 0; i < 16; ++i) {
    skipped += run.counters(i).skipped;
    samples += run.counters(i).samples;
  }
  EXPECT_GT(skipped, 0U);
  EXPECT_NEAR(static_cast<double>(samples), 5.97 * rack.rate, 32) << "no sample is lost, skipped ones have counters";
  EXPECT_LT(latest(run, rack.grids, 0), 200ms + 16 * 6 * fits + 1ms);
  EXPECT_LT(latest(run, rack.grids, 4), 16 * fits * 2 + 100us) << "a second after the load has gone";
}

}  // namespace
}  // namespace imud
