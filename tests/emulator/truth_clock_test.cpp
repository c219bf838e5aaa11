#include "emulator/truth_clock.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>

#include "tests/emulator/instants.hpp"

namespace imud {
namespace {

using namespace std::chrono_literals;

double since(TruthTime t) { return seconds(t - TruthTime{}); }

// A simulator that sends the truth of every 10 ms: that of t s at host time sent_at(t) s. The network delays each by
// a random time of mean `mean_delay_s`. The clock is read every ms.
class Stream {
 public:
  Stream(const TruthClock::Options& options, std::function<double(double)> sent_at, double mean_delay_s)
      : clock(options), sent_at_(std::move(sent_at)), delay_(1 / mean_delay_s) {}

  // Runs up to truth time `until_s`. The sampled time must always advance at a rate from `slowest` to `fastest`, in
  // seconds per second of the host. The slewing of 5 % (10 % if the delay changes, too) is within these limits.
  void run(double until_s, double slowest, double fastest) {
    for (; k_ * 0.01 < until_s; ++k_) {
      const double t = k_ * 0.01;
      const double arrival = std::max(last_arrival_, sent_at_(t) + delay_(random_));
      last_arrival_ = arrival;
      if (k_ == 0) {
        use_ = clock.begin(truth(0), host(arrival), 1);
        at_ = clock.use(use_);
        continue;
      }
      for (; use_ <= host(arrival); use_ = use_ + 1ms) {
        const TruthTime next = clock.use(use_);
        if (use_ > host_begin + 1s) {
          ASSERT_GE(seconds(next - at_), 1e-3 * slowest - 2e-9) << t;
          ASSERT_LE(seconds(next - at_), 1e-3 * fastest + 2e-9) << t;
        }
        at_ = next;
      }
      clock.observe(truth(t), host(arrival), host(arrival));
    }
  }

  TruthClock clock;

 private:
  std::function<double(double)> sent_at_;
  std::exponential_distribution<double> delay_;
  std::mt19937_64 random_{7};
  int k_ = 0;
  double last_arrival_ = 0;
  HostTime use_;
  TruthTime at_;
};

TEST(TruthClock, ANetworksDelaysAreBoundedByTheLeastLate) {
  Stream stream(
      {}, [](double t) { return t; }, 2e-3);
  stream.run(20, 0.95, 1.05);
  // The least of some 50 exponential delays of 2 ms is 40 us on the mean, above 0.4 ms with 5e-5.
  EXPECT_NEAR(stream.clock.rate(), 1.0, 1e-3);
  EXPECT_NEAR(since(stream.clock.truth(host(20))), 20.0, 1e-3);
  EXPECT_EQ(stream.clock.delay_s(), 0.0);
}

TEST(TruthClock, ARateIsFollowed) {
  for (const double rate : {0.9, 1.1, 0.999, 0.5, 1.5}) {
    Stream stream(
        {.delay = 30ms}, [rate](double t) { return t / rate; }, 1e-3);
    stream.run(20 * rate, 0, 10);  // until the rate is known, any increasing time will do
    EXPECT_NEAR(stream.clock.rate(), rate, 1e-3 * rate);
    stream.run(30 * rate, 0.95 * rate, 1.05 * rate);
    EXPECT_NEAR(since(stream.clock.truth(host(30))), 30 * rate - 0.03, 2e-3) << rate;
    const double newest_s = 30 * rate - 0.01;
    EXPECT_NEAR(stream.clock.offset_s(), newest_s / rate - newest_s, 6e-3) << rate;
  }
}

// The rate that a noisy network simulates at a true rate of 1 is measured, but not applied.
TEST(TruthClock, ARateThatCannotBeToldFromOneIsOne) {
  Stream stream(
      {}, [](double t) { return t; }, 5e-3);
  bool is_noisy = false;
  for (const double until_s : {0.5, 1.0, 2.0, 3.0, 4.0, 6.0, 8.0, 10.0}) {
    stream.run(until_s, 0, 10);
    EXPECT_EQ(stream.clock.used_rate(), 1.0) << until_s;
    is_noisy = is_noisy || std::abs(stream.clock.rate() - 1) > 1e-5;
  }
  EXPECT_TRUE(is_noisy) << "the estimate is exact: the test proves nothing";
}

TEST(TruthClock, AStepOfTheNetworksDelayIsSlewed) {
  // The network delays truth by 40 ms more from 10 s to 20 s.
  Stream stream(
      {}, [](double t) { return t + (t > 10 && t < 20 ? 0.04 : 0.0); }, 1e-4);
  stream.run(9.9, 0.95, 1.05);
  EXPECT_NEAR(since(stream.clock.truth(host(10))), 10.0, 2e-3);
  stream.run(19.9, 0.85, 1.15);
  EXPECT_NEAR(since(stream.clock.truth(host(19.9))), 19.86, 2e-3);
  EXPECT_NEAR(stream.clock.lateness_s(), 0, 2e-3) << "against those of the new delay";
  stream.run(30, 0.85, 1.15);
  EXPECT_NEAR(since(stream.clock.truth(host(30))), 30.0, 2e-3);
}

TEST(TruthClock, AnAutomaticDelayGoesWithTheJitter) {
  TruthClock clock({.automatic_percent = 99});
  std::mt19937_64 random(3);
  double jitter_s = 0.002;
  clock.begin(truth(0), host(0), 1);
  HostTime last{};
  const auto run = [&](int from, int until) {
    for (int k = from; k < until; ++k) {
      const double t = 0.01 * k;
      const HostTime arrival = std::max(last, host(t + std::uniform_real_distribution<double>(0, jitter_s)(random)));
      last = arrival;
      clock.use(arrival);
      clock.observe(truth(t), arrival, arrival);
    }
  };
  run(1, 3000);
  EXPECT_NEAR(clock.delay_s(), 0.012, 0.0015) << "an interval and the jitter";
  jitter_s = 0.02;
  run(3000, 3700);
  EXPECT_NEAR(clock.delay_s(), 0.030, 0.003) << "at once";
  jitter_s = 0.002;
  run(3700, 9000);
  EXPECT_NEAR(clock.delay_s(), 0.012, 0.0015) << "gradually";
}

TEST(TruthClock, AnAutomaticDelayIsASecondAtMost) {
  TruthClock clock({.automatic_percent = 99});
  clock.begin(truth(0), host(0), 1);
  for (int k = 1; k <= 64; ++k) {
    clock.use(host(3.0 * k));
    clock.observe(truth(3.0 * k), host(3.0 * k), host(3.0 * k));
  }
  EXPECT_EQ(clock.delay_s(), 1.0) << "three would be just enough";
}

TEST(TruthClock, BeginsAgainAtTheRateGiven) {
  Stream stream(
      {}, [](double t) { return t / 0.8; }, 1e-4);
  stream.run(10, 0, 10);
  EXPECT_NEAR(stream.clock.used_rate(), 0.8, 1e-3);
  stream.clock.begin(truth(100), host(50), stream.clock.used_rate());
  EXPECT_NEAR(seconds(stream.clock.truth(host(51)) - truth(100)), 0.8, 2e-3);
}

}  // namespace
}  // namespace imud
