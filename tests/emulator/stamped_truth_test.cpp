// Truth with stamps of a clock that hosts share: sample K is of the same truth on every host, to the nanosecond,
// whatever the host's own clock and its network are; on simulated hosts.
#include <map>
#include <random>

#include "emulator/record/recorder.hpp"
#include "tests/emulator/record/record_test.hpp"
#include "tests/support/text.hpp"
#include "transports/capture/pcapng_reader.hpp"
#include "transports/capture/record_packet.hpp"

namespace imud {
namespace {

using namespace std::chrono_literals;

constexpr Nanoseconds since_1970 = 1'795'834'994s;
constexpr Nanoseconds delay = 20ms;
constexpr double first_truth_s = 1.123456789;  // by the shared clock, after `since_1970`

class StampedTruth : public RecordTest {
 protected:
  struct Host {
    // Returns how far the shared clock is ahead of the host's, after so many seconds of the host's.
    std::function<double(double)> ahead_s = [](double) { return 0.0; };
    double latency_s = 0.2e-3;  // of the network; up to `jitter_s` more at random
    double jitter_s = 0.5e-3;
    double cut_s = 0, back_s = 0;                        // no truth arrives from the one to the other
    std::function<void(Truth&)> change = [](Truth&) {};  // before it is sent
  };
  // Runs a host for 8 s with truth at 100 Hz. Returns the truth time that each sample is of, ns, by K, without
  // samples whose motion is held.
  std::map<std::int64_t, std::int64_t> run(const Host& host) { return run(host, config(200, "")); }
  std::map<std::int64_t, std::int64_t> run(const Host& host, Config c) {
    c.realtime.epoch = Epoch::tai;
    if (c.truth.clock.automatic_percent == 0) c.truth.clock.delay = delay;
    run_.emplace(c);
    const HostTime begin = run_->at(0);
    const auto ahead = [=](HostTime now) {
      return since_1970 - (begin - HostTime{}) + nanoseconds(host.ahead_s(seconds(now - begin)));
    };
    run_->host().epoch_ahead = ahead;
    std::mt19937 random(7);
    std::uniform_real_distribution<double> jitter_s(0, host.jitter_s);
    for (int k = 0; k < 650; ++k) {
      const double sent_s = first_truth_s + 0.01 * k;
      const double shared_s = sent_s + host.latency_s + jitter_s(random);
      double arrival_s = shared_s;
      for (int i = 0; i < 5; ++i) arrival_s = shared_s - host.ahead_s(arrival_s);
      Truth truth = Swing::truth(at_s(0.01 * k));
      truth.sequence = static_cast<std::uint32_t>(k + 1);
      truth.stamp = {SharedClock::tai,
                     SharedTime{} + since_1970 + nanoseconds(first_truth_s) + (truth.time - TruthTime{})};
      host.change(truth);
      if (sent_s < host.cut_s || sent_s > host.back_s) run_->truth(arrival_s, truth);
    }
    Recorder recorder(options(), true);
    run_->recorder = &recorder;
    run_->run(8);
    recorder.finish();
    PcapngReader reader(PortSpec::parse("record:" + path("run.pcapng")));
    std::map<std::int64_t, std::int64_t> sampled;
    std::int64_t truth_ns = 0;
    bool is_held = true;
    while (const auto packet = reader.next()) {
      if (reader.interfaces()[packet->interface].link_type != link_type::event) continue;
      const auto event = decode_record_event(packet->bytes);
      if (event->type == RecordEvent::Type::sample) {
        truth_ns = event->a;
        is_held = event->flags >= static_cast<std::uint8_t>(MotionState::Basis::held) ||
                  event->a - event->b >= std::chrono::nanoseconds(100ms).count();
      }
      if (event->type != RecordEvent::Type::transmit || is_held) continue;
      const HostTime due{event->a};
      const double K = std::round(200 * (seconds(due - begin) + host.ahead_s(seconds(due - begin))));
      sampled[static_cast<std::int64_t>(K)] = truth_ns;
    }
    EXPECT_GT(sampled.size(), 200U);
    return sampled;
  }
  // The truth time that is the stamp of K less the delay.
  static std::int64_t wanted(std::int64_t K) {
    return (K * Nanoseconds(5ms) - delay - nanoseconds(first_truth_s)).count();
  }
  static void expect_exact(const std::map<std::int64_t, std::int64_t>& sampled, double from_s = 0, double to_s = 0) {
    for (const auto& [K, truth] : sampled) {
      const double due_s = static_cast<double>(K) / 200;
      if (due_s >= from_s && due_s <= to_s) continue;
      ASSERT_EQ(truth, wanted(K)) << K;
    }
  }
  std::string_view remark() { return run_->quality().stamps.text(); }

  std::optional<SimulatedRun> run_;
};

TEST_F(StampedTruth, HostsSampleTheSameTruthWhateverTheirNetworkIs) {
  for (const double latency_s : {0.2e-3, 3e-3, 7e-3}) {
    const auto sampled = run({.latency_s = latency_s, .jitter_s = 2e-3});
    expect_exact(sampled);
    EXPECT_GT(sampled.size(), 1000U);
    EXPECT_LT(run_->counters().extrapolated, 100U) << "only after the last truth";
    EXPECT_EQ(run_->quality().stamped, 650U);
    EXPECT_EQ(run_->quality().stamps_refused, 0U);
    // Sample 0 is stamped with the simulation's time at its instant.
    EXPECT_EQ(run_->left()[0].sample.time.ns, wanted(run_->counters().first_k - since_1970 / 5ms));
  }
}

// The delay is shorter than the network's: all samples are extrapolated, at the same times all the same.
TEST_F(StampedTruth, ALatencyBeyondTheDelayIsExtrapolated) {
  const auto sampled = run({.latency_s = 40e-3});
  expect_exact(sampled);
  EXPECT_GT(run_->counters().extrapolated, 1000U);
}

TEST_F(StampedTruth, AHostWhoseClockIsOffDriftsAndIsSetSamplesTheSameTruth) {
  for (const double ppm : {0.0, 100.0, -100.0}) {
    const auto sampled = run({.ahead_s = [ppm](double t) { return 0.251 + 1e-6 * ppm * t + (t > 4 ? 3.7e-3 : 0); }});
    expect_exact(sampled, 4.2, 4.6);  // until the step is noticed
    EXPECT_EQ(run_->clock().steps, 1U);
    EXPECT_GT(sampled.rbegin()->first, 1400);
  }
}

TEST_F(StampedTruth, AfterACutTheTruthIsTheSameAgain) {
  const auto sampled = run({.cut_s = 3, .back_s = 5});
  expect_exact(sampled);
  EXPECT_EQ(sampled.count(800), 0U) << "held";
  EXPECT_EQ(sampled.count(1010), 1U) << "20 ms and a truth after it is back";
  EXPECT_EQ(run_->truth_counters().gaps, 1U);
  EXPECT_EQ(run_->quality().resumed, 0U);
  EXPECT_NEAR(static_cast<double>(run_->truth_counters().lost), 200, 2);
}

// The simulator stands still for a second: from the truth after it on the map is by the new stamps.
TEST_F(StampedTruth, APauseOfTheSimulatorIsInTheStamps) {
  const auto pause = [](Truth& truth) {
    if (truth.time >= TruthTime{3'000'000'000}) truth.time = truth.time - 1s;
  };
  const auto sampled = run({.cut_s = first_truth_s + 2.995, .back_s = first_truth_s + 3.995, .change = pause});
  EXPECT_EQ(run_->quality().resumed, 1U);
  EXPECT_EQ(run_->quality().last_behind_ns, 1'000'000'000);
  std::size_t after = 0;
  for (const auto& [K, truth] : sampled) {
    if (K > 820 && K < 1050) continue;  // until the time that was extrapolated is reached
    ASSERT_EQ(truth, K < 1000 ? wanted(K) : wanted(K) - 1'000'000'000) << K;
    after += K < 1000 ? 0 : 1;
  }
  EXPECT_GT(after, 300U);
}

// A stamp that is refused changes nothing. The sensor goes on.
TEST_F(StampedTruth, AStampThatIsNotLaterIsRefused) {
  const auto sampled = run({.change = [](Truth& truth) {
    if (truth.sequence % 50 == 0) truth.stamp.time = truth.stamp.time - 500ms;
  }});
  expect_exact(sampled);
  EXPECT_EQ(run_->quality().stamps_refused, 13U);
  EXPECT_TRUE(contains(std::string(remark()), "is not later than the stamp before")) << remark();
}

// From 3 s to 4 s the stamps are those of a clock that is off by 37 s: the arrivals map the truth meanwhile.
TEST_F(StampedTruth, StampsFarFromTheArrivalGiveWayToTheArrivals) {
  const auto sampled = run({.latency_s = 2e-3, .jitter_s = 0, .change = [](Truth& truth) {
                              if (truth.sequence > 300 && truth.sequence <= 400)
                                truth.stamp.time = truth.stamp.time - 37s;
                            }});
  expect_exact(sampled, 4, 5.2);
  for (const auto& [K, truth] : sampled) ASSERT_NEAR(static_cast<double>(truth - wanted(K)), 0, 3e6) << K;
  EXPECT_EQ(run_->quality().stamps_refused, 100U);
  EXPECT_TRUE(contains(std::string(remark()), "37.002")) << remark();
  EXPECT_EQ(run_->counters().missed, 0U);
}

TEST_F(StampedTruth, AnotherClockOrAnAutomaticDelayIsNamed) {
  run({.change = [](Truth& truth) { truth.stamp.clock = SharedClock::utc; }});
  EXPECT_EQ(run_->quality().stamps_refused, 650U);
  EXPECT_TRUE(contains(std::string(remark()), "\"utc\", which is not realtime.epoch")) << remark();
  Config c = config(200, "");
  c.truth.clock.automatic_percent = 99;
  run({}, c);
  EXPECT_EQ(run_->quality().stamped, 0U);
  EXPECT_EQ(run_->quality().stamps_refused, 0U);
  EXPECT_TRUE(contains(std::string(remark()), "give a delay, the same on all hosts")) << remark();
}

}  // namespace
}  // namespace imud
