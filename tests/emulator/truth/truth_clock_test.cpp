#include "emulator/truth/truth_clock.hpp"

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

TEST(TruthClock, AnAutomaticDelayIsSettledOnceAndRaisedIfItHasToBe) {
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
      if (k > 101) clock.use(arrival);
      clock.observe(truth(t), arrival, arrival);
    }
  };
  run(1, 100);
  EXPECT_FALSE(clock.is_settled(host(0.99))) << "with so much jitter it takes a second";
  run(100, 102);
  ASSERT_TRUE(clock.is_settled(last));
  const TruthClock::Settled settled = clock.settle(truth(1.01), last);
  const double delay_s = clock.delay_s();
  EXPECT_NEAR(delay_s, 0.0128, 0.001) << "an interval, the jitter, a quarter of it, and 0.5 ms";
  EXPECT_NEAR(settled.interval_s, 0.01, 1e-12);
  EXPECT_NEAR(settled.jitter_s, 0.002, 0.001);
  EXPECT_NEAR(settled.duration_s, 1.01, 0.003);
  EXPECT_GE(settled.begin, last);
  EXPECT_NEAR(seconds(clock.truth(settled.begin) - truth(1.01)), 0, 2e-9);
  EXPECT_NEAR(seconds(settled.begin - host(1.01)), delay_s, 1e-3);
  run(102, 3000);
  EXPECT_EQ(clock.delay_s(), delay_s) << "as long as it is enough";
  EXPECT_EQ(clock.delay_raises(), 0U);
  jitter_s = 0.02;
  run(3000, 3700);
  const double raised_s = clock.delay_s();
  EXPECT_GT(raised_s, 0.029) << "an interval and the jitter";
  EXPECT_LT(raised_s, 0.037);
  EXPECT_GT(clock.delay_raises(), 0U);
  jitter_s = 0.002;
  run(3700, 9000);
  EXPECT_GT(clock.delay_s(), raised_s - 53 * 50e-6) << "50 us a second";
  EXPECT_LT(clock.delay_s(), raised_s - 40 * 50e-6);
}

// A single truth that is late at the beginning must not decide on the delay.
TEST(TruthClock, AnOutlierDoesNotSettleTheDelay) {
  TruthClock clock({.automatic_percent = 99});
  clock.begin(truth(0), host(0), 1);
  for (int k = 1; k <= 25; ++k) {
    const double t = 0.01 * k;
    clock.observe(truth(t), host(t + (k == 7 ? 0.009 : 0)), host(t));
  }
  ASSERT_TRUE(clock.is_settled(host(0.25)));
  clock.settle(truth(0.25), host(0.25));
  EXPECT_LT(clock.delay_s(), 0.014);
}

// 99 % of the last 512 arrivals: five that are late are left out, and a sixth is not.
TEST(TruthClock, AnAutomaticDelayLeavesOutOnePercent) {
  for (const int late : {5, 6}) {
    TruthClock clock({.automatic_percent = 99});
    clock.begin(truth(0), host(0), 1);
    const auto run = [&](int from, int until) {
      for (int k = from; k < until; ++k) {
        const bool is_late = k >= 1000 && k < 1000 + 40 * late && k % 40 == 0;
        const HostTime arrival = host(0.01 * k + (is_late ? 0.008 : 0));
        if (k > 101) clock.use(arrival);
        clock.observe(truth(0.01 * k), arrival, arrival);
      }
    };
    run(1, 102);
    ASSERT_TRUE(clock.is_settled(host(1.01)));
    clock.settle(truth(1.01), host(1.01));
    const double settled_s = clock.delay_s();
    run(102, 1600);
    EXPECT_EQ(clock.delay_s() > settled_s + 0.005, late > 5) << late << ' ' << clock.delay_s();
    EXPECT_EQ(clock.delay_raises(), late > 5 ? 1U : 0U) << late;
  }
}

TEST(TruthClock, AnAutomaticDelayIsASecondAtMost) {
  TruthClock clock({.automatic_percent = 99});
  clock.begin(truth(0), host(0), 1);
  EXPECT_FALSE(clock.is_settled(host(0.99)));
  EXPECT_TRUE(clock.is_settled(host(1)));
  EXPECT_EQ(clock.settle(truth(0), host(1)).begin, host(1)) << "there is a single truth";
  for (int k = 1; k <= 64; ++k) {
    clock.use(host(3.0 * k));
    clock.observe(truth(3.0 * k), host(3.0 * k), host(3.0 * k));
  }
  EXPECT_EQ(clock.delay_s(), 1.0) << "three would be just enough";
}

// The edge of the arrivals of a second moves by as much as a millisecond, that of four seconds does not.
TEST(TruthClock, JitterHardlyMovesTheOffset) {
  TruthClock clock({.delay = 50ms});
  std::mt19937_64 random(8);
  std::uniform_real_distribution<double> jitter_s(0, 0.02);
  clock.begin(truth(0), host(0.005), 1);
  double sum = 0, squares = 0;
  int count = 0;
  HostTime last{};
  for (int k = 1; k < 3000; ++k) {
    const double t = 0.01 * k;
    last = std::max(last, host(t + jitter_s(random)));
    clock.observe(truth(t), last, last);
    if (k < 300) continue;
    const double offset_s = seconds(last - host(0)) - 0.05 - since(clock.use(last));
    sum += offset_s;
    squares += offset_s * offset_s;
    ++count;
  }
  ASSERT_GT(count, 2600);
  EXPECT_LT(std::sqrt(squares / count - sum / count * sum / count), 60e-6);
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
