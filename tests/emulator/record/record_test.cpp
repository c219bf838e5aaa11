// A run is recorded and repeated from its record: the same bytes, whatever truth, hosts and the supply have done.
#include "tests/emulator/record/record_test.hpp"

#include <map>
#include <random>

#include "emulator/config/load_config.hpp"
#include "tests/emulator/control/mode_clients.hpp"

namespace imud {
namespace {

using namespace std::chrono_literals;

// A KeptLine with a host that writes every 0.1 to 60 ms.
class HostedLine final : public KeptLine {
 public:
  HostedLine(SimulatedHost& host, ModeClient& client, std::string& sent)
      : KeptLine(sent), host_(host), client_(client) {}
  void reply(std::span<const Frame> frames) noexcept override {
    for (const Frame& frame : frames)
      answer_.append(reinterpret_cast<const char*>(frame.bytes.data()), frame.bytes.size());
    KeptLine::reply(frames);
  }
  std::optional<Received> receive() noexcept override {
    if (is_executing_) client_.on_executed(std::exchange(answer_, {}), host_.now());
    is_executing_ = false;
    if (host_.now() < next_) return std::nullopt;
    next_ = host_.now() + 100us + Nanoseconds(random_() % 60'000'000);
    written_ = client_.write(host_.now());
    is_executing_ = true;
    ++commands;
    return Received{{std::as_bytes(std::span(written_))}, host_.now() - 20us};
  }
  int descriptor() const noexcept override { return 1001; }
  HostTime next() const { return next_; }
  std::size_t commands = 0;

 private:
  SimulatedHost& host_;
  ModeClient& client_;
  std::mt19937_64 random_{7};
  HostTime next_ = host_.now() + 1s;
  std::string written_, answer_;
  bool is_executing_ = false;
};

// Four imus at rates that have no common period, one with every kind of noise, one at rest before the first truth;
// truth that jitters, is lost, reordered, repeated and damaged, pauses, jumps, and restarts; power cycles; a host
// that is held up so long that samples are skipped.
TEST_F(RecordTest, RepeatsARunInRealTime) {
  const std::string text = R"(clock = "realtime"
seed = 7
realtime.skip_after_ms = 200
[truth]
port = "udp:127.0.0.1:9810"
extrapolate_ms = 30
)";
  std::string imus;
  const std::array<std::pair<double, std::string>, 4> all = {
      {{1000, "model = \"stim300\"\n"},
       {333.3,
        "before_first = \"rest\"\nclock.frequency_random_walk_ppm_per_rt_hr = 1000\nclock.temperature_ppm_per_c = "
        "0.3\n"
        "temperature.warm_up_c = 30\ntemperature.warm_up_s = 5\nstamp_jitter_us = 5\n"},
       {7, ""},
       {200, "phase_us = 1700\nclock.phase_random_walk_ns_per_rt_s = 3000\n"}}};
  for (std::size_t i = 0; i < all.size(); ++i)
    imus += fmt::format("[[imu]]\nname = \"i{}\"\nport = \"file:{}\"\nprotocol = \"native\"\nrate_hz = {}\n{}{}", i,
                        i, all[i].first,
                        i == 0 ? "" : "gyro.max_rad_per_s = 100\naccelerometer.max_m_per_s2 = 1000\n", all[i].second);
  const Config config = load_config(write("config.toml", text + imus));
  std::vector<std::string> sent(all.size());
  Recorder recorder(options(), true);
  SimulatedRun run(config);
  run.recorder = &recorder;
  std::size_t next = 0;
  run.make_sensor = [&](SimulatedHost&) { return std::make_unique<KeptLine>(sent[next++]); };
  std::mt19937 random(5);
  const auto below = [&random](unsigned n) { return static_cast<double>(random() % n); };
  for (int k = 0; k < 3000; ++k) {
    const double t = 0.01 * k, jump = k > 2000 ? 100 : k > 1500 ? -5 : k > 900 ? 5 : 0;
    const double arrival = 1 + t + (k > 1200 ? 1 : 0);         // the simulator pauses for 1 s
    if ((k > 700 && k < 760) || random() % 50 == 0) continue;  // a pause; a loss
    const double late = 1e-5 * below(400) + (random() % 20 == 0 ? 0.015 : 0);
    run.truth(arrival + late, Swing::truth(at_s(t + jump)));
    if (random() % 30 == 0) run.truth(arrival + late + 0.001, Swing::truth(at_s(t + jump)));
    if (random() % 30 == 0) run.garbage(arrival);
  }
  run.host().freeze(run.at(12.3), run.at(12.9));
  HostTime power_at = run.at(4);
  run.host().on_wait = [&] {
    if (run.host().now() < power_at) return;
    power_at = run.host().now() + 5s;
    run.engine().power_cycle.make();
  };
  run.run(34);
  recorder.finish();
  EXPECT_EQ(recorder.counters().lost, 0U);
  EXPECT_GT(run.quality().resumed, 0U);
  EXPECT_GT(run.quality().leaps, 0U);
  EXPECT_GT(run.counters(0).extrapolated, 100U);
  EXPECT_GT(run.counters(0).held, 100U);
  EXPECT_GT(run.counters(0).skipped, 100U);
  EXPECT_GT(run.counters(1).at_rest, 100U);
  EXPECT_GT(run.truth_counters().runs, 0U);
  EXPECT_GT(run.truth_counters().inserted, 0U);
  const std::vector<std::string> repeated = repeat(config);
  for (std::size_t i = 0; i < sent.size(); ++i) {
    EXPECT_GT(sent[i].size(), 10'000U) << i;
    EXPECT_TRUE(repeated[i] == sent[i]) << i << ": " << repeated[i].size() << " and " << sent[i].size();
  }
  // Another seed makes other bytes at the same instants.
  Config other = config;
  other.seed = 8;
  const std::vector<std::string> differing = repeat(other);
  EXPECT_EQ(differing[0].size(), sent[0].size());
  EXPECT_FALSE(differing[0] == sent[0]);
}

// A host that changes modes, filters and rates: its bytes come from the record, at the device's times of the run.
TEST_F(RecordTest, RepeatsWhatAHostHasCaused) {
  Stim300Client stim300;
  VectorNavClient vectornav;
  MipClient mip;
  for (ModeClient* const client :
       {static_cast<ModeClient*>(&stim300), static_cast<ModeClient*>(&vectornav), static_cast<ModeClient*>(&mip)}) {
    SCOPED_TRACE(client->configuration());
    const Config config = load_config(write("config.toml",
                                            "clock = \"realtime\"\n[truth]\nport = \"udp:127.0.0.1:9810\"\n"
                                            "[[imu]]\nport = \"pty:imu\"\n" +
                                                client->configuration()));
    std::string sent;
    Recorder recorder(options(), true);
    SimulatedRun run(config);
    run.recorder = &recorder;
    HostedLine* line = nullptr;
    run.make_sensor = [&](SimulatedHost& host) {
      auto made = std::make_unique<HostedLine>(host, *client, sent);
      line = made.get();
      host.next_input = [&](int) { return line->next(); };
      return made;
    };
    for (int k = 0; k < 2000; ++k) run.truth(5 + 0.01 * k, Swing::truth(at_s(0.01 * k)));
    HostTime power_at = run.at(5);
    run.host().on_wait = [&] {
      if (run.host().now() < power_at) return;
      power_at = run.host().now() + 7s;
      run.engine().power_cycle.make();
      client->on_power(run.host().now());
    };
    run.run(25);
    recorder.finish();
    EXPECT_GT(line->commands, 500U);
    const std::string repeated = repeat(config)[0];
    EXPECT_GT(sent.size(), 10'000U);
    EXPECT_TRUE(repeated == sent) << repeated.size() << " and " << sent.size();
  }
}

// A packet for which the queue has no room is counted, its place is marked, and a replay reports it.
TEST_F(RecordTest, CountsAndMarksWhatTheQueueCouldNotTake) {
  Recorder recorder(options(), false, 4096);
  const std::uint16_t interface = recorder.add_interface("imu1", link_type::bytes);
  const std::array<std::byte, 100> bytes{};
  for (int i = 0; i < 100; ++i) recorder.packet(interface, PacketDirection::outbound, HostTime{i}, {bytes});
  const std::uint64_t lost = recorder.counters().lost;
  EXPECT_GT(lost, 70U);
  EXPECT_LT(lost, 100U);
  recorder.start(true, "");
  while (recorder.counters().packets == 0) std::this_thread::sleep_for(1ms);
  recorder.event({.type = RecordEvent::Type::end});
  recorder.finish();
  EXPECT_EQ(recorder.counters().packets, 100 - lost + 2) << "the mark, and the end";
  EXPECT_EQ(recorder.counters().lost, lost);

  PcapngReader reader(PortSpec::parse("record:" + path("run.pcapng")));
  std::vector<RecordEvent> events;
  std::size_t frames = 0;
  while (const auto packet = reader.next()) {
    const bool is_event = reader.interfaces()[packet->interface].link_type == link_type::event;
    if (is_event) events.push_back(decode_record_event(packet->bytes).value_or(RecordEvent{}));
    frames += is_event ? 0 : 1;
  }
  EXPECT_EQ(frames, 100 - lost);
  ASSERT_EQ(events.size(), 3U);
  EXPECT_EQ(events[1].type, RecordEvent::Type::lost);
  EXPECT_EQ(events[1].a, static_cast<std::int64_t>(lost));
}

// Each loss is marked once, with its own number, although other packets follow.
TEST_F(RecordTest, MarksEachLossOnce) {
  Recorder recorder(options(), false, 4096);
  const std::uint16_t interface = recorder.add_interface("imu1", link_type::bytes);
  recorder.start(true, "");
  const std::array<std::byte, 100> bytes{};
  const auto lost = [&]() -> std::uint64_t { return recorder.counters().lost; };
  // Returns true if there was room for the event; if not, it is lost, too.
  const auto has_room = [&] {
    const std::uint64_t before = lost();
    recorder.event({.type = RecordEvent::Type::end});
    return lost() == before;
  };
  for (int losses = 0; losses < 3; ++losses) {
    const std::uint64_t before = lost();
    while (lost() == before)
      for (int i = 0; i < 100; ++i) recorder.packet(interface, PacketDirection::outbound, HostTime{i}, {bytes});
    for (int events = 0; events < 3; std::this_thread::sleep_for(1ms)) events += has_room() ? 1 : 0;
  }
  recorder.finish();
  PcapngReader reader(PortSpec::parse("record:" + path("run.pcapng")));
  std::uint64_t marks = 0, marked = 0;
  while (const auto packet = reader.next()) {
    if (reader.interfaces()[packet->interface].link_type != link_type::event) continue;
    const RecordEvent event = decode_record_event(packet->bytes).value_or(RecordEvent{});
    if (event.type != RecordEvent::Type::lost) continue;
    ++marks;
    marked += static_cast<std::uint64_t>(event.a);
  }
  EXPECT_GE(marks, 3U);
  EXPECT_EQ(marked, lost());
}

// A port drops the last of the frames that it is passed.
TEST_F(RecordTest, FramesThatThePortHasDroppedAreNotRecordedAsSent) {
  Recorder recorder(options(), true);
  const std::uint16_t interface = recorder.add_interface("imu1", link_type::bytes);
  recorder.add_interface("imu1 host", link_type::bytes);
  recorder.add_interface("imu1 dropped", link_type::bytes);
  recorder.start(true, "");
  const std::array<std::byte, 3> bytes = {std::byte{1}, std::byte{2}, std::byte{3}};
  std::array<Frame, 3> frames;
  for (std::size_t i = 0; i < frames.size(); ++i) frames[i].bytes = std::span(bytes).subspan(i, 1);
  for (const std::uint64_t dropped : {0U, 1U, 3U, 5U}) recorder.frames(interface, frames, dropped);
  recorder.finish();
  PcapngReader reader(PortSpec::parse("record:" + path("run.pcapng")));
  std::string seen;
  while (const auto packet = reader.next()) {
    const PcapngInterface& of = reader.interfaces()[packet->interface];
    if (of.link_type == link_type::bytes)
      seen += fmt::format("{}{} ", of.name == "imu1" ? "+" : "-", std::to_integer<int>(packet->bytes[0]));
  }
  EXPECT_EQ(seen, "+1 +2 +3 +1 +2 -3 -1 -2 -3 -1 -2 -3 ");
}

}  // namespace
}  // namespace imud
