// A stop in each state of a run: the run ends within the documented 20 ms of its clock, without further samples.
#include <unistd.h>

#include <csignal>
#include <cstdlib>

#include "emulator/engine/closing.hpp"
#include "tests/emulator/record/record_test.hpp"
#include "tests/emulator/run/live_test.hpp"
#include "transports/host_clock.hpp"

namespace imud {
namespace {

using namespace std::chrono_literals;

class Stop : public RecordTest {
 protected:
  static constexpr const char* a_capture = "pcap:flight.pcap?port=9810";  // which is not opened

  // Ends the process if a stopped run takes so many waits more, in place of a test that never ends.
  static void bound(SimulatedHost& host) {
    host.on_wait = [&host, waits = 0]() mutable {
      if (!host.stop || ++waits < 100) return;
      ADD_FAILURE() << "the run goes on after the stop";
      std::abort();
    };
  }
  // Runs with truth at 100 Hz from 0.1 s until `truth_s`, and is stopped at `stop_s`.
  static void run_until(SimulatedRun& run, double truth_s, double stop_s) {
    for (int k = 0; 0.1 + 0.01 * k <= truth_s; ++k) run.truth(0.1 + 0.01 * k, Swing::truth(at_s(0.01 * k)));
    bound(run.host());
    run.run(stop_s);
    EXPECT_GE(run.host().now(), run.at(stop_s));
    EXPECT_LE(run.host().now(), run.at(stop_s) + 20ms);
    EXPECT_TRUE(drain(run.engine(), 50ms));
  }
  // Replays 5 s of a capture until `stop_at` after the begin.
  struct Seen {
    HostTime begin, end;
    std::uint64_t samples;
    bool at_end;
  };
  static Seen replay(Config config, Nanoseconds stop_at) {
    config.truth.port = a_capture;
    SimulatedHost host;
    bound(host);
    const HostTime begin = host.now();
    host.end = begin + stop_at;
    for (int k = 0; k <= 500; ++k) {
      std::vector<std::byte> bytes(native_truth_size);
      encode_native_truth(Swing::truth(at_s(0.01 * k)), std::span<std::byte, native_truth_size>(bytes));
      host.arrivals.push_back({begin, std::move(bytes)});
    }
    std::vector<Left> left;
    Assembly run(config, [&](const PortUse& use) -> std::unique_ptr<Port> {
      if (use.of == PortUse::Of::truth) return std::make_unique<SimulatedTruth>(host, true);
      return std::make_unique<SimulatedSensor>(host, left);
    });
    run.run(host, host.stop);
    return {begin, host.now(), left.size(), run.engine().intake().at_end()};
  }
};

TEST_F(Stop, WhileNoTruthHasCome) {
  for (const char* before : {"rest", "silence"}) {
    SimulatedRun run(config(100, "", fmt::format("before_first = \"{}\"", before)));
    run_until(run, 0, 1);
    EXPECT_EQ(run.left().empty(), std::string_view(before) == "silence");
  }
}

TEST_F(Stop, WhileTruthIsMissing) {
  SimulatedRun run(config(100, "delay_ms = 20"));
  run_until(run, 1, 3);
  EXPECT_NEAR(static_cast<double>(run.left().size()), 288, 2) << "from 0.12 s on; motion is held";
}

TEST_F(Stop, WhileTheDelayIsSettled) {
  Config c = config(100, "", "before_first = \"silence\"");
  c.truth.clock.automatic_percent = 99;
  SimulatedRun run(c);
  run_until(run, 0.15, 0.16);
  EXPECT_TRUE(run.left().empty());
}

TEST_F(Stop, InLockstepWhileItWaitsForTruth) {
  Config c = config(100, "");
  c.clock = ClockMode::lockstep;
  SimulatedRun run(c);
  run_until(run, 1, 3);
  EXPECT_EQ(run.left().size(), 91U) << "those whose truth has come";
}

// The host was held up for 5 s, and is stopped in that time: no sample of the hold-up is skipped or sent.
TEST_F(Stop, WhileItIsBehind) {
  SimulatedRun run(config(1000, "delay_ms = 20"));
  run.host().freeze(run.at(1.5), run.at(6.5));
  run_until(run, 7, 6.5);
  EXPECT_LE(run.counters().skipped, 1U);
  EXPECT_NEAR(static_cast<double>(run.counters().samples), 1380, 2) << "from 0.12 s on";
}

// Each sample takes longer than its period: the run skips samples until it is stopped.
TEST_F(Stop, WhileItSkips) {
  Config c = config(1000, "delay_ms = 20");
  c.realtime.skip_after = 100ms;
  SimulatedRun run(c);
  run.host().send_cost = 5ms;
  run_until(run, 3, 3);
  EXPECT_GT(run.counters().skipped, 1000U);
}

TEST_F(Stop, InAReplayAtItsPace) {
  const Seen seen = replay(config(100, ""), 2s);
  EXPECT_LE(seen.end, seen.begin + 2s + 20ms);
  EXPECT_NEAR(static_cast<double>(seen.samples), 200, 2);
  EXPECT_FALSE(seen.at_end);
}

// The clock goes on by 2 us with each truth.
TEST_F(Stop, InAReplayAtOnce) {
  Config c = config(100, "");
  c.clock = ClockMode::fast;
  const Seen seen = replay(c, 2us * 250);
  EXPECT_NEAR(static_cast<double>(seen.samples), 250, 3);
  EXPECT_FALSE(seen.at_end);
}

// The stop comes with a frame: no other frame leaves.
TEST_F(Stop, InARepetition) {
  class StoppingLine final : public KeptLine {
   public:
    StoppingLine(std::string& sent, std::atomic<bool>& stop) : KeptLine(sent), stop_(stop) {}
    void send(std::span<const Frame> frames) noexcept override {
      KeptLine::send(frames);
      if (counters_.sent == 50) stop_ = true;
    }

   private:
    std::atomic<bool>& stop_;
  };
  Config c = config(100, "");
  Recorder recorder(options(), false);
  SimulatedRun recorded(c);
  recorded.recorder = &recorder;
  run_until(recorded, 2, 2);
  recorder.finish();
  c.truth.port = "record:" + path("run.pcapng");
  for (const ClockMode clock : {ClockMode::fast, ClockMode::realtime}) {
    c.clock = clock;
    SimulatedHost host;
    host.end = SimulatedHost::never;
    bound(host);
    std::string sent;
    Assembly run(c, [&](const PortUse&) { return std::make_unique<StoppingLine>(sent, host.stop); },
                 {.repeats = true});
    run.run(host, host.stop);
    EXPECT_EQ(sent.size(), 50U * 125U) << "124 bytes, and the border of a frame";
    EXPECT_FALSE(run.engine().intake().at_end());
    EXPECT_EQ(run.difference(), "");
  }
}

// A line whose reader reads nothing is waited for, for 2 s in steps of 10 ms. The stop comes while it is waited for.
TEST_F(Stop, InLockstepWhileAReaderIsWaitedFor) {
  class FullLine final : public Port {
   public:
    FullLine(int descriptor, std::atomic<bool>& stop, std::size_t& looks)
        : descriptor_(descriptor), stop_(stop), looks_(looks) {}
    void send(std::span<const Frame>) noexcept override {}
    std::optional<Received> receive() noexcept override { return std::nullopt; }
    // Called at least once in a step.
    int descriptor() const noexcept override {
      if (++looks_ == 20) stop_ = true;
      return descriptor_;
    }

   private:
    const int descriptor_;
    std::atomic<bool>& stop_;
    std::size_t& looks_;
  };
  std::array<int, 2> ends{};
  ASSERT_EQ(::pipe2(ends.data(), O_NONBLOCK | O_CLOEXEC), 0);
  const FileDescriptor reader(ends[0]), writer(ends[1]);
  const std::string bytes(4096, '\0');
  while (::write(writer.get(), bytes.data(), bytes.size()) > 0) continue;
  Config c = config(100, "");
  c.clock = ClockMode::lockstep;
  SimulatedRun run(c);
  std::size_t looks = 0;
  run.make_sensor = [&](SimulatedHost& host) { return std::make_unique<FullLine>(writer.get(), host.stop, looks); };
  for (int k = 0; k <= 10; ++k) run.truth(0.1, Swing::truth(at_s(0.01 * k)));
  bound(run.host());
  run.run(1000);
  EXPECT_GE(looks, 20U);
  EXPECT_LT(looks, 40U);
  EXPECT_LE(run.counters().samples, 2U);
}

using StopLive = LiveTest;

TEST_F(StopLive, BeforeAReaderHasCome) {
  const std::string pty = "pty:" + path("imu");
  ASSERT_EQ(run_program("imu-truth", {"spiral", "--csv", path("truth.csv"), "--for", "1"}).exit_code, 0);
  for (const bool is_live : {true, false}) {
    const std::string c = is_live ? config("realtime", simulator_.port(), "native", 100, "native", pty)
                                  : config("fast", "file:" + path("truth.csv"), "csv", 100, "native", pty);
    Program imud("imud");
    imud.start({"run", c, "--wait-for-reader", "--summary", path("summary.json")});
    ASSERT_TRUE(imud.wait_for_errors("waiting for a reader of " + pty)) << imud.errors();
    EXPECT_EQ(imud.stop(SIGTERM), is_live ? 0 : 3) << imud.errors();
    EXPECT_EQ(summary()["ended_by"], "signal");
    EXPECT_EQ(summary()["imus"][0]["frames"], 0);
  }
}

}  // namespace
}  // namespace imud
