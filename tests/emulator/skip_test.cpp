// Samples that are later than `[realtime] skip_after_ms` after the host or the process was stopped.
#include <csignal>
#include <thread>

#include "emulator/config/load_config.hpp"
#include "tests/emulator/run/live_test.hpp"
#include "tests/emulator/run/realtime_test.hpp"
#include "tests/support/text.hpp"

namespace imud {
namespace {

using namespace std::chrono_literals;

class Skip : public RealtimeTest {
 protected:
  // A run at 1 kHz of truth at 100 Hz, whose host is stopped from 1.5 s until `until_s`.
  void run(const std::string& keys, double until_s) {
    Config c = config(1000, "delay_ms = 20");
    c.realtime = load_config(path("config.toml"), std::vector{keys}).realtime;
    run_ = std::make_unique<SimulatedRun>(c);
    for (int k = 0; k <= 850; ++k) run_->truth(0.1 + 0.01 * k, Swing::truth(at_s(0.01 * k)));
    run_->host().freeze(run_->at(1.5), run_->at(until_s));
    run_->run(8.5);
  }
  std::unique_ptr<SimulatedRun> run_;
};

// 5 s without the host: the samples of the last second leave late, those before are skipped, and all others are in
// time. What leaves has the counter, the time and the motion of a sensor that went on.
TEST_F(Skip, OnlyWhatIsTooLateIsLeftOut) {
  for (const auto& [keys, skipped] : {std::pair{"seed=1", 4000U}, {"realtime.skip_after_ms=4000", 1000U}}) {
    run(keys, 6.5);
    const std::vector<Left>& left = run_->left();
    EXPECT_NEAR(static_cast<double>(run_->counters().skipped), skipped, 20) << "time passes meanwhile";
    ASSERT_EQ(left.size(), run_->counters().samples - run_->counters().skipped);
    EXPECT_EQ(run_->counters().frames, left.size());
    EXPECT_NEAR(static_cast<double>(run_->counters().samples), 8380, 2);
    std::uint64_t gaps = 0;
    double worst = 0;
    for (std::size_t i = 0; i < left.size(); ++i) {
      const std::uint64_t k = left[i].sample.counter;
      if (i > 0 && k != left[i - 1].sample.counter + 1) {
        ++gaps;
        EXPECT_EQ(k - left[i - 1].sample.counter - 1, run_->counters().skipped);
      }
      ASSERT_EQ(left[i].sample.time.ns, static_cast<std::int64_t>(k) * 1'000'000);
      // The map of the simulator's clock is slewed after the hold-up.
      const double rate = Swing::truth(at_s(1e-3 * static_cast<double>(k))).omega_BN_B.z();
      worst = std::max(worst, std::abs(left[i].sample.rate.z() - rate));
      if (i > 0) {
        ASSERT_LT(left[i].sample.delta_angle.norm(), 4e-3) << "increments are those of one period";
      }
    }
    EXPECT_EQ(gaps, 1U);
    EXPECT_LT(worst, 0.2) << "rad/s: 10 ms of the motion";
    EXPECT_EQ(run_->counters().extrapolated, 0U);
    EXPECT_LE(run_->counters().lateness.max(), 1e-3 * (5000 - skipped) + 0.05);
  }
}

TEST_F(Skip, AShortHoldUpSkipsNothing) {
  run("seed=1", 2.45);
  EXPECT_EQ(run_->counters().skipped, 0U);
  EXPECT_EQ(run_->left().size(), run_->counters().samples);
  EXPECT_GT(run_->counters().missed, 900U);
}

using SkipLive = LiveTest;

TEST_F(SkipLive, AfterSigstopTheSensorGoesOnWithoutABurst) {
  const std::string c = config("realtime", simulator_.port(), "native", 200, "csv", "file:" + path("out"));
  Program imud("imud");
  start(imud, c, {"--set", "realtime.skip_after_ms=500"});
  Program truth("imu-truth");
  truth.start({"turntable", "--to", simulator_.port(), "--rate", "200", "--for", "120"});
  const auto written = [&] { return read_file(path("out")).size(); };
  ASSERT_TRUE(eventually([&] { return written() > 100; }));
  imud.kill(SIGSTOP);
  std::this_thread::sleep_for(2500ms);
  imud.kill(SIGCONT);
  ASSERT_TRUE(imud.wait_for_errors("more than 500 ms late (realtime.skip_after_ms)"));
  const std::size_t after = written();
  ASSERT_TRUE(eventually([&] { return written() > after + 100; }));
  EXPECT_EQ(imud.stop(), 0);
  truth.kill();
  EXPECT_EQ(count(imud.errors(), "realtime.skip_after_ms"), 1U);
  const auto imu = summary()["imus"][0];
  const std::uint64_t skipped = imu["skipped"], frames = imu["frames"], samples = imu["samples"];
  EXPECT_GE(skipped, 350U) << "2 s at 200 Hz, but the process may stop a little later";
  EXPECT_EQ(frames + skipped, samples + 1) << "the header row is a frame";
  const auto all = rows(read_file(path("out")));
  ASSERT_EQ(all.size(), frames - 1);
  EXPECT_EQ(std::stoul(all.back()[1]), samples - 1);
}

// A replay in which samples are missing is incomplete.
TEST_F(SkipLive, ASkippedSampleOfAReplayIsMissing) {
  ASSERT_EQ(run_program("imu-truth", {"spiral", "--csv", path("truth.csv"), "--for", "3"}).exit_code, 0);
  const std::string c = config("realtime", simulator_.port(), "csv", 200, "csv", "file:" + path("out"));
  Program imud("imud");
  imud.start({"replay", c, path("truth.csv"), "--set", "realtime.skip_after_ms=200"});
  ASSERT_TRUE(eventually([&] { return read_file(path("out.incomplete")).size() > 100; }));
  imud.kill(SIGSTOP);
  std::this_thread::sleep_for(1s);
  imud.kill(SIGCONT);
  EXPECT_EQ(imud.wait(), 3);
  EXPECT_TRUE(contains(imud.errors(), "samples skipped")) << imud.errors();
}

}  // namespace
}  // namespace imud
