// The delay that a configuration without truth.delay_ms has: settled before the first sample, so that motion is
// interpolated from then on; on a simulated clock.
#include "emulator/config/load_config.hpp"
#include "tests/emulator/run/realtime_test.hpp"

namespace imud {
namespace {

// Coning of 10 Hz: the rate is (-a sin wt, a cos wt, -2 w sin^2(angle/2)).
struct Coning {
  static constexpr double frequency = 20 * units::pi, angle = 0.02;  // rad/s, rad
  static double amplitude() { return frequency * std::sin(angle); }  // 1.26 rad/s

  static Truth truth(double t, std::uint32_t sequence) {
    Truth truth;
    truth.time = at_s(t);
    truth.sequence = sequence;
    const double phase = frequency * t;
    truth.q_NB = Quaternion(std::cos(angle / 2), std::sin(angle / 2) * std::cos(phase),
                            std::sin(angle / 2) * std::sin(phase), 0);
    truth.omega_BN_B = {-amplitude() * std::sin(phase), amplitude() * std::cos(phase),
                        -2 * frequency * std::pow(std::sin(angle / 2), 2)};
    truth.has_specific_force = true;
    truth.specific_force_B = truth.q_NB.conjugate() * Vector3(0, 0, -9.8);
    return truth;
  }
};

class AutomaticDelay : public RealtimeTest {
 protected:
  // Without delay_ms, unlike RealtimeTest::config().
  Config config(const std::string& imu = "", const std::string& truth = "") const {
    return load_config(write("config.toml", "clock = \"realtime\"\n[truth]\nport = \"udp:127.0.0.1:9810\"\n" + truth +
                                                "[[imu]]\nname = \"i\"\nport = \"file:i\"\nprotocol = \"native\"\n"
                                                "rate_hz = 1000\ngyro.max_rad_per_s = 100\n"
                                                "accelerometer.max_m_per_s2 = 1000\n" +
                                                imu));
  }
  // Truths from time 100 s on, that of 100 s + t after 0.1 s + t; each is late by up to `jitter_s`.
  static void send(SimulatedRun& run, double until_s, double jitter_s, double truth_hz = 100) {
    std::mt19937_64 random(4);
    std::uniform_real_distribution<double> late_s(0, jitter_s + 1e-12);
    const int truths = static_cast<int>(until_s * truth_hz);
    for (int k = 0; k < truths; ++k) {
      const double t = k / truth_hz;
      run.truth(0.1 + t + late_s(random), Coning::truth(100 + t, static_cast<std::uint32_t>(k)));
    }
  }
  // The rms of what is left of the gyro's x and y after the best sine and cosine of the coning, in the device's time.
  static double residual(const std::vector<Left>& left, double from_s, double until_s) {
    double sine = 0, cosine = 0, squares = 0;
    std::size_t count = 0;
    const auto each = [&](auto function) {
      for (const Left& one : left) {
        const double t = seconds(one.sample.time - left[0].sample.time);
        const double phase = Coning::frequency * t;
        if (t >= from_s && t < until_s) function(one.sample.rate, std::sin(phase), std::cos(phase));
      }
    };
    // x = -a sin(phase + p), y = a cos(phase + p).
    each([&](const Vector3& rate, double s, double c) {
      cosine += rate.y() * c - rate.x() * s;
      sine += -rate.y() * s - rate.x() * c;
      ++count;
    });
    cosine /= static_cast<double>(count);
    sine /= static_cast<double>(count);
    each([&](const Vector3& rate, double s, double c) {
      squares += std::pow(rate.y() - (cosine * c - sine * s), 2) + std::pow(rate.x() + cosine * s + sine * c, 2);
    });
    return std::sqrt(squares / (2.0 * static_cast<double>(count)));
  }
};

TEST_F(AutomaticDelay, IsRightFromTheFirstSampleOn) {
  for (const std::string before : {"silence", "rest"}) {
    SimulatedRun run(config("before_first = \"" + before + "\"\n"));
    send(run, 5, 0);
    run.run(5);
    std::vector<Left> of_truth;
    for (const Left& left : run.left())
      if ((left.sample.status & status::at_rest) == 0) of_truth.push_back(left);
    ASSERT_GT(of_truth.size(), 4600U) << before;
    EXPECT_LT(residual(of_truth, 0, 5), 0.005);
    EXPECT_EQ(run.counters().extrapolated, 0U);
    // The run begins with the truth after 200 ms, which is sampled an interval and the margin later.
    EXPECT_NEAR(run.since_begin(of_truth[0].time), 0.1 + 0.2 + 0.0105, 1e-3);
    EXPECT_NEAR(run.quality().delay_s, 0.0105, 1e-4);
    EXPECT_EQ(run.counters().at_rest > 0, before == "rest");
    if (before == "silence") {
      const double stamp_s = seconds(of_truth[0].sample.time - DeviceTime{});
      EXPECT_NEAR(stamp_s, 100.2, 1e-9) << "its time is that of the truth";
      for (const Left& left : of_truth) {
        const double phase = Coning::frequency * seconds(left.sample.time - DeviceTime{});
        ASSERT_NEAR(left.sample.rate.y(), Coning::amplitude() * std::cos(phase), 0.01) << phase;
      }
    }
  }
}

TEST_F(AutomaticDelay, WithJitterItIsRightThreeSecondsLater) {
  SimulatedRun run(config());
  send(run, 12, 0.02);
  run.run(12);
  ASSERT_GT(run.left().size(), 10'500U);
  EXPECT_LT(residual(run.left(), 2, 10.5), 0.005);
  EXPECT_LT(run.quality().delay_s, 0.045);
}

TEST_F(AutomaticDelay, IsSettledWithinASecondAtAnyTruthRate) {
  for (const double truth_hz : {1000.0, 50.0, 10.0, 3.0, 0.5}) {
    SimulatedRun run(config());
    send(run, 5, 0, truth_hz);
    run.run(5);
    ASSERT_GT(run.left().size(), 2000U) << truth_hz;
    const double begin_s = run.since_begin(run.left()[0].time) - 0.1;
    EXPECT_LT(begin_s, 1 + std::min(1.0, 1 / truth_hz) + 0.03) << truth_hz;
    EXPECT_GE(begin_s, 0.2) << truth_hz;
    EXPECT_NEAR(run.quality().delay_s, std::min(1.0, 1 / truth_hz + 0.0005), 1e-4) << truth_hz;
    EXPECT_EQ(run.quality().delay_raises, 0U);
  }
}

// A simulator that starts again while the delay is being settled.
TEST_F(AutomaticDelay, BeginsAnewWithTheSimulator) {
  SimulatedRun run(config());
  for (int k = 0; k < 10; ++k) run.truth(0.1 + 0.01 * k, Coning::truth(50 + 0.01 * k, static_cast<std::uint32_t>(k)));
  for (int k = 0; k < 100; ++k) {
    Truth truth = Coning::truth(10 + 0.01 * k, static_cast<std::uint32_t>(k));
    truth.new_run = k == 0;
    run.truth(0.2 + 0.01 * k, truth);
  }
  run.run(1);
  ASSERT_GT(run.left().size(), 500U);
  EXPECT_NEAR(run.since_begin(run.left()[0].time), 0.2 + 0.2 + 0.0105, 1e-3);
  EXPECT_NEAR(seconds(run.left()[0].sample.time - DeviceTime{}), 10.2, 1e-9);
  EXPECT_NEAR(run.quality().delay_s, 0.0105, 1e-4);
}

TEST_F(AutomaticDelay, IsZeroByChoiceAndThenNothingIsAwaited) {
  SimulatedRun run(config("", "delay_ms = 0\n"));
  send(run, 2, 0);
  run.run(2);
  ASSERT_GT(run.left().size(), 1800U);
  EXPECT_NEAR(run.since_begin(run.left()[0].time), 0.1, 1e-4);
  EXPECT_GT(run.counters().extrapolated, 1600U);
  EXPECT_GT(residual(run.left(), 0, 2), 0.02);
}

}  // namespace
}  // namespace imud
