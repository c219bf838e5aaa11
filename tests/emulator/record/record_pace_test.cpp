// A record that is repeated in real time is sent by the same rules as a run: lateness is measured, and the frames of
// samples that are too late are not sent.
#include "tests/emulator/record/record_test.hpp"

namespace imud {
namespace {

using namespace std::chrono_literals;

class RecordPaceTest : public RecordTest {
 protected:
  // Records four seconds of the sensor on a host that is never held up. Returns the bytes that the sensor sent.
  std::string record() {
    Recorder recorder(options(), true);
    SimulatedRun run(config_);
    run.recorder = &recorder;
    std::string sent;
    run.make_sensor = [&](SimulatedHost&) { return std::make_unique<KeptLine>(sent); };
    for (int k = 0; k < 400; ++k) run.truth(1 + 0.01 * k, Swing::truth(at_s(0.01 * k)));
    run.run(5);
    recorder.finish();
    samples_ = run.counters().samples;
    EXPECT_GT(static_cast<double>(samples_), 3 * config_.imus[0].rate_hz);
    EXPECT_EQ(run.counters().missed, 0U);
    return sent;
  }
  struct Seen {
    std::uint64_t samples, missed, skipped, late;
  };
  // Repeats the record on a host that is held up for so long, two seconds after its start.
  Seen repeat_held_up(Nanoseconds time, std::string& sent) {
    SimulatedHost host;
    host.freeze(host.now() + 2s, host.now() + 2s + time);
    Seen seen{};
    sent = repeat(config_, host, [&](const Engine& engine) {
      const ImuCounters& counters = engine.channels()[0]->counters;
      seen = {counters.samples, counters.missed, counters.skipped, counters.lateness.count()};
    })[0];
    return seen;
  }
  Config config_ = config(1000, "");
  std::uint64_t samples_ = 0;
};

// The samples of a hold-up are a period late, or more, but for the last. They leave.
TEST_F(RecordPaceTest, LatenessIsMeasured) {
  const std::string run = record();
  for (const int ms : {0, 600}) {
    std::string sent;
    const Seen seen = repeat_held_up(Nanoseconds(1ms) * ms, sent);
    EXPECT_EQ(seen.samples, samples_);
    EXPECT_EQ(seen.late, samples_) << "the lateness of each is measured";
    EXPECT_NEAR(static_cast<double>(seen.missed), ms, ms == 0 ? 0 : 1);
    EXPECT_EQ(seen.skipped, 0U);
    EXPECT_TRUE(sent == run);
  }
}

// Samples that are later than `skip_after_ms`, 1000, are skipped. The samples of the hold-up's last second are sent.
TEST_F(RecordPaceTest, SamplesThatAreTooLateAreSkipped) {
  const std::string run = record();
  std::string sent;
  const Seen seen = repeat_held_up(1500ms, sent);
  EXPECT_EQ(seen.samples, samples_);
  EXPECT_NEAR(static_cast<double>(seen.skipped), 500, 1);
  EXPECT_NEAR(static_cast<double>(seen.missed), 1000, 1);
  EXPECT_EQ(sent.size() * samples_, run.size() * (samples_ - seen.skipped)) << "frames of equal length, one a sample";
  EXPECT_TRUE(sent.ends_with(run.substr(run.size() - 100)));
}

// A signal ends the wait for a sample that is far away, and the sample is not sent.
TEST_F(RecordPaceTest, AStopEndsTheWait) {
  config_ = config(1, "");
  record();
  SimulatedHost host;
  const HostTime begin = host.now();
  host.end = begin + 1300ms;
  config_.truth.port = "record:" + path("run.pcapng");
  std::string sent;
  Assembly run(config_, [&](const PortUse&) { return std::make_unique<KeptLine>(sent); }, {.repeats = true});
  run.run(host, host.stop);
  EXPECT_EQ(run.engine().channels()[0]->counters.samples, 2U) << "at 0 and 1 s";
  EXPECT_LE(host.now(), begin + 1300ms + 20ms);
}

}  // namespace
}  // namespace imud
