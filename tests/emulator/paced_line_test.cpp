// The real-time loops wake for the pace of a line, and sample when they would without it; on a simulated clock.
#include "tests/emulator/realtime_test.hpp"
#include "transports/paced_writer.hpp"
#include "transports/port.hpp"

namespace imud {
namespace {

using namespace std::chrono_literals;
using testing::RealtimeTest;
using testing::SimulatedHost;
using testing::SimulatedRun;
using testing::Swing;

constexpr UartSettings line{460'800};
constexpr std::size_t frame_size = 124;  // of the native protocol

struct Heard {
  std::vector<HostTime> sent;                                // a frame each
  std::vector<std::pair<HostTime, std::size_t>> characters;  // how many came together
};

// A pty's line without the pty.
class PacedSensor final : public Port {
 public:
  PacedSensor(SimulatedHost& host, Heard& heard) : host_(host), heard_(heard) {}
  void send(std::span<const Frame> frames) noexcept override {
    flush();
    for (std::size_t i = 0; i < frames.size(); ++i) heard_.sent.push_back(host_.now());
    writer_.queue(frames, line, host_.now(), std::chrono::milliseconds(100), counters_);
  }
  void flush() noexcept override {
    const HostTime now = host_.now();
    std::size_t together = 0;
    for (auto bytes = writer_.ready(now); !bytes.empty(); bytes = writer_.ready(now)) {
      together += bytes.size();
      writer_.written(bytes.size(), now, counters_);
    }
    if (together > 0) heard_.characters.emplace_back(now, together);
  }
  std::optional<Received> receive() noexcept override { return std::nullopt; }
  std::optional<HostTime> next_flush() const noexcept override { return writer_.next_flush(); }

 private:
  SimulatedHost& host_;
  Heard& heard_;
  PacedWriter writer_;
};

class PacedLine : public RealtimeTest {
 protected:
  // Portions of 14 and a last one of 12 of each frame, when they have come, or a little later by what else there was
  // to do.
  static void expect_pace(const Heard& heard, Nanoseconds late) {
    std::size_t next = 0;
    for (std::size_t frame = 0; frame + 1 < heard.sent.size(); ++frame)
      for (std::size_t seen = 0; seen < frame_size;) {
        ASSERT_LT(next, heard.characters.size());
        const auto [time, together] = heard.characters[next++];
        seen += together;
        ASSERT_TRUE(together == PacedWriter::fifo || seen == frame_size) << together;
        const Nanoseconds lateness = time - (heard.sent[frame] + Nanoseconds(seen * 10'000'000'000 / line.baud));
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
    Heard heard;
    run.make_sensor = [&](SimulatedHost& host) { return std::make_unique<PacedSensor>(host, heard); };
    for (SimulatedRun* each : {&unpaced, &run}) {
      for (int k = 0; k < 200; ++k)
        each->truth(0.1 + 0.01 * k, Swing::truth(TruthTime{10'000'000 * std::int64_t{k}}));
      each->run(2);
    }
    ASSERT_GT(heard.sent.size(), 300U);
    ASSERT_EQ(heard.sent.size(), unpaced.left().size());
    for (std::size_t k = 0; k < heard.sent.size(); ++k) {
      ASSERT_GE(heard.sent[k], unpaced.left()[k].time - 20us) << k;
      ASSERT_LE(heard.sent[k], unpaced.left()[k].time + 20us) << k;
    }
    expect_pace(heard, c.realtime.spin + 50us);
  }
}

TEST_F(PacedLine, APacedReplayWakesForIt) {
  ASSERT_EQ(run_program("imu-truth", {"spiral", "--csv", path("truth.csv"), "--for", "2"}).exit_code, 0);
  const Config c =
      load_config(RunTest::config("realtime", "file:" + path("truth.csv"), "csv", 200, "native", "file:any"));
  SimulatedHost host;
  host.end = host.now() + 100s;
  Heard heard;
  Session session(c, [&](std::string_view port, const PortSettings& settings) {
    return settings.role == Role::listener ? open_port(port, settings) : std::make_unique<PacedSensor>(host, heard);
  });
  const HostTime begin = host.now();
  CapturePacer pacer;
  Loop(session, host, pacer, {.spin = {}, .limit = {}}, host.stop).run();
  ASSERT_GT(heard.sent.size(), 390U);
  for (std::size_t k = 0; k < heard.sent.size(); ++k) ASSERT_EQ(heard.sent[k], begin + 5ms * k) << k;
  expect_pace(heard, 1ns);  // instants are rounded up
}

}  // namespace
}  // namespace imud
