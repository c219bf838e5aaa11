// All clocks give the same bytes: every protocol in real time, in lockstep and fast, with a clock error and a phase,
// on a simulated host.
#include <algorithm>
#include <string>
#include <vector>

#include "emulator/config/load_config.hpp"
#include "tests/emulator/run/realtime_test.hpp"
#include "tests/protocols/table_names.hpp"

namespace imud {
namespace {

// Records all frames sent to a port, with their identifiers; feeds the host's bytes to the device after some of them.
class RecordingPort final : public Port {
 public:
  RecordingPort(std::string& record, std::string host_bytes) : record_(record), host_bytes_(std::move(host_bytes)) {}
  void send(std::span<const Frame> frames) noexcept override {
    for (const Frame& frame : frames) {
      record_ += fmt::format("{:x}:", frame.can.id);
      record_.append(reinterpret_cast<const char*>(frame.bytes.data()), frame.bytes.size());
    }
    counters_.count_sent(is_reply_, frames.size());
  }
  bool has_input() const noexcept { return counters_.sent >= 500 && !host_bytes_.empty(); }
  int descriptor() const noexcept override { return 1001; }
  std::optional<Received> receive() noexcept override {
    if (!has_input()) return std::nullopt;
    received_ = std::move(host_bytes_);
    host_bytes_.clear();
    return Received{{std::as_bytes(std::span(received_))}, {}};
  }

 private:
  std::string& record_;
  std::string host_bytes_, received_;
};

class ThreeClocks : public RealtimeTest, public ::testing::WithParamInterface<const Protocol*> {
 protected:
  static std::string host_bytes(std::string_view protocol) {
    if (protocol == "vectornav") return "$VNRRG,01*72\r\n$VNWRG,06,1*6D\r\n";
    if (protocol == "stim300") return "N\rSERVICEMODE\rs\rx\r";
    if (protocol == "mip") return std::string("\x75\x65\x01\x02\x02\x01\xE0\xC6", 8);
    return "";
  }

  // Six seconds of truth, with a restart in between if `restarts`.
  std::string record(ClockMode clock, bool capture, bool restarts, const std::string& errors = "") {
    const Protocol& protocol = *GetParam();
    const bool can = protocol.link == Link::can;
    Config config = load_config(write(
        "config.toml",
        fmt::format("clock = \"realtime\"\nseed = 5\n[truth]\nport = \"udp:127.0.0.1:9810\"\ndelay_ms = 30\n[[imu]]\n"
                    "protocol = \"{}\"\nport = \"{}\"\nclock_error_ppm = 300\nphase_us = 137\n"
                    "before_first = \"silence\"\ngyro.max_rad_per_s = 100\naccelerometer.max_m_per_s2 = 1000\n{}{}",
                    protocol.name, can ? "can:vcan0" : "pty:imu", protocol.product ? "" : "rate_hz = 400\n", errors) +
            (protocol.name == "stim300"    ? "device.start_up = false\n"
             : protocol.name == "canopen"  ? "device.self_start = true\n"
             : protocol.name == "nos3-imu" ? "device.with_requests = true\n"
                                           : "")));
    config.clock = clock;
    if (capture) config.truth.port = "pcap:flight.pcap?port=9810";
    SimulatedHost host;
    const HostTime begin = host.now();
    for (int run = 0; run < (restarts ? 2 : 1); ++run)
      for (int k = 0; k <= 600; ++k) {
        Truth truth = Swing::truth(TruthTime{10'000'000 * std::int64_t{k + 300}});
        truth.new_run = k == 0;
        std::vector<std::byte> bytes(native_truth_size);
        encode_native_truth(truth, std::span<std::byte, native_truth_size>(bytes));
        host.arrivals.push_back({begin + nanoseconds(0.1 + 0.01 * k + 10 * run), std::move(bytes)});
      }
    // In real time the last truths are not sampled.
    host.end = begin + std::chrono::seconds(clock == ClockMode::realtime && !capture ? 6 : 100);
    std::string record;
    Assembly assembly(config, [&](const PortUse& use) -> std::unique_ptr<Port> {
      if (use.of == PortUse::Of::truth) return std::make_unique<SimulatedTruth>(host, capture, Nanoseconds{0});
      auto recording = std::make_unique<RecordingPort>(record, host_bytes(protocol.name));
      host.next_input = [recording = recording.get()](int) {
        return recording->has_input() ? HostTime{} : SimulatedHost::never;
      };
      return recording;
    });
    assembly.run(host, host.stop);
    const ImuCounters& counters = assembly.engine().channels()[0]->counters;
    EXPECT_EQ(counters.extrapolated, 0U);
    EXPECT_GT(static_cast<double>(counters.samples), config.imus[0].rate_hz * (restarts ? 11.75 : 5.75));
    return record;
  }
};

TEST_P(ThreeClocks, GiveTheSameBytes) {
  const std::string fast = record(ClockMode::fast, true, false);
  EXPECT_GT(fast.size(), 5'000U);
  EXPECT_TRUE(record(ClockMode::lockstep, false, false) == fast);
  EXPECT_TRUE(record(ClockMode::realtime, true, false) == fast) << "a capture at its own pace";
  const std::string live = record(ClockMode::realtime, false, false);
  EXPECT_GT(live.size(), fast.size() * 95 / 100);
  // A node on a bus starts up and sends its status by the time since power on, which is before the first truth here.
  const bool has_timers =
      GetParam()->link == Link::can && GetParam()->make(Settings(GetParam()->settings))->deadline();
  EXPECT_TRUE(has_timers || fast.starts_with(live))
      << std::mismatch(live.begin(), live.end(), fast.begin()).first - live.begin();
}

// A free-running clock in a chamber, with its wander, and stamps that are off.
constexpr const char* clock_errors =
    "clock.frequency_random_walk_ppm_per_rt_hr = 3000\nclock.phase_random_walk_ns_per_rt_s = 5000\n"
    "clock.temperature_ppm_per_c2 = -0.04\ntemperature.profile_s = [0, 6]\ntemperature.profile_c = [-40, 85]\n"
    "stamp_offset_us = 20\nstamp_jitter_us = 5\n";

TEST_P(ThreeClocks, GiveTheSameBytesOfAWanderingClock) {
  const std::string fast = record(ClockMode::fast, true, false, clock_errors);
  EXPECT_TRUE(record(ClockMode::lockstep, false, false, clock_errors) == fast);
  EXPECT_TRUE(record(ClockMode::realtime, true, false, clock_errors) == fast);
  const std::string live = record(ClockMode::realtime, false, false, clock_errors);
  const bool has_timers =
      GetParam()->link == Link::can && GetParam()->make(Settings(GetParam()->settings))->deadline();
  EXPECT_TRUE(has_timers || fast.starts_with(live))
      << std::mismatch(live.begin(), live.end(), fast.begin()).first - live.begin();
  EXPECT_FALSE(fast == record(ClockMode::fast, true, false));
  const std::string again = record(ClockMode::fast, true, true, clock_errors);
  EXPECT_TRUE(record(ClockMode::lockstep, false, true, clock_errors) == again);
}

// In the clocks that truth paces, a second run sets the sensor's clock to its first truth.
TEST_P(ThreeClocks, GiveTheSameBytesOverARestart) {
  const std::string fast = record(ClockMode::fast, true, true);
  EXPECT_GT(fast.size(), 10'000U);
  EXPECT_TRUE(record(ClockMode::lockstep, false, true) == fast);
  EXPECT_TRUE(record(ClockMode::realtime, true, true) == fast);
}

INSTANTIATE_TEST_SUITE_P(Table, ThreeClocks, ::testing::ValuesIn(protocols().begin(), protocols().end()),
                         test_name<Protocol>);

}  // namespace
}  // namespace imud
