// The real-time loops wake up for a paced line, and take their samples at the same times as without it; on a
// simulated clock.
#include "emulator/config/load_config.hpp"
#include "tests/emulator/run/realtime_test.hpp"
#include "transports/port.hpp"
#include "transports/uart/paced_writer.hpp"

namespace imud {
namespace {

using namespace std::chrono_literals;

constexpr UartSettings line{460'800};
constexpr std::size_t frame_size = 124;  // of the native protocol

struct Recording {
  std::vector<HostTime> sent;                                // of each frame
  std::vector<std::pair<HostTime, std::size_t>> characters;  // time and number of characters sent together
};

// The paced line of a pty, without the pty.
class PacedSensor final : public Port {
 public:
  PacedSensor(SimulatedHost& host, Recording& recording) : host_(host), recording_(recording) {}
  void send(std::span<const Frame> frames) noexcept override {
    flush();
    for (std::size_t i = 0; i < frames.size(); ++i) recording_.sent.push_back(host_.now());
    writer_.queue(frames, line, host_.now(), std::chrono::milliseconds(100), counters_);
  }
  void flush() noexcept override {
    const HostTime now = host_.now();
    std::size_t together = 0;
    for (auto bytes = writer_.ready(now); !bytes.empty(); bytes = writer_.ready(now)) {
      together += bytes.size();
      writer_.written(bytes.size(), now, counters_);
    }
    if (together > 0) recording_.characters.emplace_back(now, together);
  }
  std::optional<Received> receive() noexcept override { return std::nullopt; }
  std::optional<HostTime> next_flush() const noexcept override { return writer_.next_flush(); }

 private:
  SimulatedHost& host_;
  Recording& recording_;
  PacedWriter writer_;
};

class PacedLine : public RealtimeTest {
 protected:
  // Each frame is sent in portions of 14 characters and a last one of 12, each when its characters are complete on
  // the line, or up to `late` later.
  static void expect_pace(const Recording& recording, Nanoseconds late) {
    std::size_t next = 0;
    for (std::size_t frame = 0; frame + 1 < recording.sent.size(); ++frame)
      for (std::size_t seen = 0; seen < frame_size;) {
        ASSERT_LT(next, recording.characters.size());
        const auto [time, together] = recording.characters[next++];
        seen += together;
        ASSERT_TRUE(together == PacedWriter::fifo || seen == frame_size) << together;
        const Nanoseconds lateness = time - (recording.sent[frame] + Nanoseconds(seen * 10'000'000'000 / line.baud));
        ASSERT_GE(lateness.count(), 0) << frame;
        ASSERT_LE(lateness, late) << frame << " " << seen;
      }
  }
};

TEST_F(PacedLine, TheRealtimeLoopWakesForIt) {
  for (const std::string spin : {"0", "200"}) {
    Config c = config(200, "delay_ms = 20");
    c.realtime.spin = nanoseconds(1e-6 * std::stod(spin));
    SimulatedRun unpaced(c), run(c);
    Recording recording;
    run.make_sensor = [&](SimulatedHost& host) { return std::make_unique<PacedSensor>(host, recording); };
    for (SimulatedRun* each : {&unpaced, &run}) {
      for (int k = 0; k < 200; ++k)
        each->truth(0.1 + 0.01 * k, Swing::truth(TruthTime{10'000'000 * std::int64_t{k}}));
      each->run(2);
    }
    ASSERT_GT(recording.sent.size(), 300U);
    ASSERT_EQ(recording.sent.size(), unpaced.left().size());
    for (std::size_t k = 0; k < recording.sent.size(); ++k) {
      ASSERT_GE(recording.sent[k], unpaced.left()[k].time - 20us) << k;
      ASSERT_LE(recording.sent[k], unpaced.left()[k].time + 20us) << k;
    }
    expect_pace(recording, c.realtime.spin + 50us);
  }
}

TEST_F(PacedLine, APacedReplayWakesForIt) {
  ASSERT_EQ(run_program("imu-truth", {"spiral", "--csv", path("truth.csv"), "--for", "2"}).exit_code, 0);
  const Config c =
      load_config(RunTest::config("realtime", "file:" + path("truth.csv"), "csv", 200, "native", "file:any"));
  SimulatedHost host;
  host.end = host.now() + 100s;
  Recording recording;
  Assembly assembly(c, [&](const PortUse& use) {
    return use.of == PortUse::Of::truth ? real_ports(use) : std::make_unique<PacedSensor>(host, recording);
  });
  const HostTime begin = host.now();
  assembly.run(host, host.stop);
  ASSERT_GT(recording.sent.size(), 390U);
  for (std::size_t k = 0; k < recording.sent.size(); ++k) ASSERT_EQ(recording.sent[k], begin + 5ms * k) << k;
  expect_pace(recording, 1ns);  // instants are rounded up
}

}  // namespace
}  // namespace imud
