// A recorded run receives more than datagrams of truth: edges at pins, hosts at a second UART, truth of a stream,
// and truth that is derived.
#include <fmt/chrono.h>

#include <chrono>
#include <deque>

#include "emulator/config/load_config.hpp"
#include "protocols/sync_datagram.hpp"
#include "tests/emulator/record/record_test.hpp"
#include "transports/host_clock.hpp"

namespace imud {
namespace {

using namespace std::chrono_literals;

// A pin, or a line with a host: datagrams or commands that come at their times.
class TimedLine final : public KeptLine {
 public:
  using Inputs = std::deque<std::pair<HostTime, std::string>>;
  TimedLine(SimulatedHost& host, Inputs& inputs, std::string& sent, int fd)
      : KeptLine(sent), host_(host), inputs_(inputs), fd_(fd) {}
  std::optional<Received> receive() noexcept override {
    if (inputs_.empty() || inputs_.front().first > host_.now()) return std::nullopt;
    current_ = std::move(inputs_.front().second);
    inputs_.pop_front();
    return Received{{std::as_bytes(std::span(current_))}, host_.now()};
  }
  int descriptor() const noexcept override { return fd_; }

 private:
  SimulatedHost& host_;
  Inputs& inputs_;
  const int fd_;
  std::string current_;
};

class RecordInputs : public RecordTest {
 protected:
  // Runs for `s` seconds; returns what the sensors have sent.
  std::vector<std::string> record(SimulatedRun& run, std::size_t lines, double s) {
    std::vector<std::string> sent(lines);
    Recorder recorder(options(), true);
    run.recorder = &recorder;
    std::size_t next = 0;
    run.make_sensor = [&](SimulatedHost& host) {
      const std::size_t i = next++;
      return std::make_unique<TimedLine>(host, inputs_[i], sent[i], 1001 + static_cast<int>(i));
    };
    run.host().next_input = [this](int fd) {
      const TimedLine::Inputs& inputs = inputs_[static_cast<std::size_t>(fd - 1001)];
      return inputs.empty() ? SimulatedHost::never : inputs.front().first;
    };
    run.open_pin = [&](const PortUse&) { return std::make_unique<TimedLine>(run.host(), edges_, edge_sent_, -1); };
    run.run(s);
    recorder.finish();
    EXPECT_EQ(recorder.counters().lost, 0U);
    return sent;
  }
  // The delay is 0 unless `truth` has another.
  Config imu(std::string truth, const std::string& keys) const {
    if (truth.find("delay_ms = ") == std::string::npos) truth += "\ndelay_ms = 0";
    return load_config(
        write("config.toml", fmt::format("clock = \"realtime\"\n[truth]\n{}\n[[imu]]\n{}\n", truth, keys)));
  }
  static constexpr const char* native =
      "protocol = \"native\"\nport = \"file:x\"\nrate_hz = 200\n"
      "gyro.max_rad_per_s = 100\naccelerometer.max_m_per_s2 = 1000\n";
  static constexpr const char* udp = "port = \"udp:127.0.0.1:9810\"";
  // Two seconds of truth at 100 Hz, from 0.5 s on.
  static void fly(SimulatedRun& run) {
    for (int k = 0; k < 200; ++k) run.truth(0.5 + 0.01 * k, Swing::truth(at_s(0.01 * k)));
  }
  std::array<TimedLine::Inputs, 2> inputs_;
  TimedLine::Inputs edges_;
  std::string edge_sent_;
};

TEST_F(RecordInputs, EdgesAtAPinAreRepeated) {
  const Config config = imu(udp,
                            "protocol = \"stim300\"\nport = \"file:x\"\ndevice.sample_rate = 0\n"
                            "device.start_up = false\nsync.trigger_port = \"udp:127.0.0.1:9811\"");
  SimulatedRun run(config);
  fly(run);
  for (int k = 0; k < 100; ++k) {
    const std::int64_t ns = 17'000'000 * k;  // some edges have no time
    edges_.emplace_back(run.at(0.5 + 0.016 * k),
                        k % 7 == 0 ? std::string() : std::string(reinterpret_cast<const char*>(&ns), sizeof ns));
  }
  const std::vector<std::string> sent = record(run, 1, 3);
  EXPECT_GT(sent[0].size(), 80U * 60);
  EXPECT_TRUE(repeat(config) == sent);
}

TEST_F(RecordInputs, AHostAtASecondUartIsRepeated) {
  const Config config = imu(udp,
                            "protocol = \"vectornav\"\ndevice.model = \"vn-200\"\nport = \"pty:a\"\n"
                            "second_port = \"pty:b\"\ndevice.async_type = 0");
  SimulatedRun run(config);
  fly(run);
  inputs_[0].emplace_back(run.at(1), "$VNWRG,75,2,8,01,0001*XX\r\n");
  inputs_[1].emplace_back(run.at(1.2), "$VNRRG,04*77\r\n");
  const std::vector<std::string> sent = record(run, 2, 3);
  EXPECT_NE(sent[0].find("$VNWRG,75,2"), std::string::npos);
  EXPECT_NE(sent[1].find("$VNRRG,04,2.1.0.0"), std::string::npos);
  EXPECT_GT(sent[1].size(), 1000U) << "the output";
  EXPECT_TRUE(repeat(config) == sent);
}

// Where truth paces, a host is served with the samples too, also on a machine that has run for longer than an hour.
TEST_F(RecordInputs, AHostInLockstepIsRepeated) {
  const Config config = load_config(
      write("config.toml", fmt::format("clock = \"lockstep\"\n[truth]\n{}\n[[imu]]\nprotocol = \"vectornav\"\n"
                                       "port = \"pty:a\"\ndevice.async_type = 0\n",
                                       udp)));
  SimulatedRun run(config);
  constexpr double uptime_s = 7200;
  for (int k = 0; k < 200; ++k) run.truth(uptime_s + 0.01 * k, Swing::truth(at_s(0.01 * k)));
  constexpr double within_s = 1e-6;  // while a truth is received, before its sample
  inputs_[0].emplace_back(run.at(uptime_s + 0.5 + within_s), "$VNWRG,75,1,8,01,0001*XX\r\n");
  const std::vector<std::string> sent = record(run, 1, uptime_s + 2.5);
  EXPECT_NE(sent[0].find("$VNWRG,75,1"), std::string::npos);
  EXPECT_GT(sent[0].size(), 1000U) << "the output";
  EXPECT_TRUE(repeat(config) == sent);
}

// A host's bytes give orders to the unit's own filter, and are recorded: the repetition aligns again at the same
// sample.
TEST_F(RecordInputs, OrdersToAFilterAreRepeated) {
  const Config config = load_config(write(
      "config.toml", fmt::format("clock = \"lockstep\"\n[truth]\n{}\n[earth]\nframe = \"local\"\nlatitude_deg = 48\n"
                                 "longitude_deg = 11\n[[imu]]\nprotocol = \"vectornav\"\nport = \"pty:a\"\n"
                                 "device.async_type = 1\nmodel = \"white\"\nnavigation.solution = \"attitude\"\n"
                                 "navigation.alignment_s = 0.2\n",
                                 udp)));
  const auto run_with = [&](const char* order) {
    SimulatedRun run(config);
    fly(run);
    inputs_[0] = {{run.at(1.2), std::string("$VNKMD,1*XX\r\n")}, {run.at(1.5), std::string(order)}};
    return record(run, 1, 2.5);
  };
  const std::vector<std::string> ping = run_with("$VNRRG,1*XX\r\n");
  EXPECT_TRUE(repeat(config) == ping);
  for (const char* order : {"$VNRST*XX\r\n", "$VNSIH,100*XX\r\n"}) {
    const std::vector<std::string> sent = run_with(order);
    EXPECT_GT(sent[0].size(), 1000U);
    const auto tail = [](const std::string& text) { return text.substr(text.size() - 500); };
    EXPECT_NE(tail(sent[0]), tail(ping[0])) << order;
    EXPECT_TRUE(repeat(config) == sent) << order;
  }
}

// A line is cut by the connection's end; the next one goes on, and a third begins a run.
TEST_F(RecordInputs, TruthOfAStreamIsRepeated) {
  const Config config =
      imu("port = \"tcp-listen:127.0.0.1:9810\"\nformat = \"csv\"", std::string(native) + "name = \"a\"");
  SimulatedRun run(config);
  const std::string header = "time_ns,sigma_BN_1,sigma_BN_2,sigma_BN_3,omega_BN_B_x,omega_BN_B_y,omega_BN_B_z\n";
  double arrival = 0.5;
  for (const double begin_s : {0.0, 0.6, 0.0}) {
    std::string text = header;
    for (int k = 0; k < 50; ++k)
      text += fmt::format("{},0,0,{},0,0,{}\n", static_cast<std::int64_t>(1e9 * begin_s) + 10'000'000 * k, 0.01 * k,
                          0.04 * k);
    text.resize(text.size() - 5);
    for (std::size_t at = 0; at < text.size(); at += 37, arrival += 0.007)
      run.arrival(arrival, std::string_view(text).substr(at, 37));
    run.arrival(arrival, "");
    arrival += 0.1;
  }
  const std::vector<std::string> sent = record(run, 1, arrival + 0.5);
  EXPECT_EQ(run.truth_counters().disconnections, 3U);
  EXPECT_EQ(run.truth_counters().runs, 2U);
  EXPECT_EQ(run.truth_counters().truncated, 3U);
  EXPECT_GT(sent[0].size(), 10'000U);
  EXPECT_TRUE(repeat(config) == sent);
}

// The simulator restarts further ahead than truth.max_gap_ms: its third truth begins a run.
TEST_F(RecordInputs, ARestartAheadOfDerivedTruthIsRepeated) {
  const Config config = imu(std::string(udp) + "\nrate = \"derived\"\nmax_gap_ms = 1000\ndelay_ms = 50",
                            std::string(native) + "name = \"a\"");
  SimulatedRun run(config);
  for (int k = 0; k < 300; ++k) run.truth(0.5 + 0.01 * k, Swing::truth(at_s(0.01 * k + (k < 150 ? 0 : 20))));
  const std::vector<std::string> sent = record(run, 1, 4);
  EXPECT_EQ(run.truth_counters().runs, 2U);
  EXPECT_GT(sent[0].size(), 10'000U);
  EXPECT_TRUE(repeat(config) == sent);
}

// The times of a fault that waits for the host count from the first sample after that.
TEST_F(RecordInputs, AFaultThatBeginsByTheHostIsRepeated) {
  constexpr double host_s = 1.3021;
  const auto sent = [&](const std::string& begin, const std::string& host) {
    const Config config =
        imu(udp, std::string(native) + "name = \"a\"\n" +
                     (begin.empty()
                          ? std::string()
                          : "[[fault]]\ntarget = \"gyro\"\nkind = \"bias\"\nvalue = 1\nfor_samples = 20\n" + begin));
    SimulatedRun run(config);
    fly(run);
    inputs_[0].clear();
    for (std::size_t i = 0; i < host.size(); ++i)
      inputs_[0].emplace_back(run.at(host_s - 0.01 * static_cast<double>(host.size() - 1 - i)), host.substr(i, 1));
    const std::vector<std::string> all = record(run, 1, 3);
    if (!begin.starts_with("at_time")) {
      EXPECT_TRUE(repeat(config) == all) << begin;
    }
    return all[0];
  };
  // Frames of 124 bytes, and a border.
  const std::string clean = sent("", "");
  const auto changed = [&](const std::string& bytes) {
    std::vector<std::size_t> samples;
    EXPECT_EQ(bytes.size(), clean.size());
    for (std::size_t at = 0; at + 125 <= std::min(clean.size(), bytes.size()); at += 125)
      if (bytes.compare(at, 125, clean, at, 125) != 0) samples.push_back(at / 125);
    return samples;
  };
  const std::vector<std::size_t> any = changed(sent("after_host = \"any\"\n", "x"));
  ASSERT_EQ(any.size(), 20U);
  EXPECT_EQ(any.back() - any.front(), 19U);
  std::vector<std::size_t> later = any;
  for (std::size_t& sample : later) sample += 50;
  EXPECT_EQ(changed(sent("after_host = {text = \"GO\"}\n", "GxGO")), any);
  EXPECT_EQ(changed(sent("after_host = {hex = \"47 4f\"}\nat_s = 0.25\n", "GGO")), later);
  EXPECT_EQ(changed(sent("after_host = {text = \"GO\"}\n", "GxO")), std::vector<std::size_t>());
  // UTC less host time is that of the clocks now, within much less than a sample's 5 ms.
  const auto utc = std::chrono::duration_cast<Nanoseconds>(std::chrono::system_clock::now().time_since_epoch()) -
                   Nanoseconds(host_now().ns);
  const SimulatedRun run(imu(udp, std::string(native) + "name = \"a\"\n"));
  const std::int64_t ns = run.at(host_s).ns + utc.count();
  const auto at_time =
      fmt::format("at_time = {:%Y-%m-%dT%H:%M:%S}.{:09}Z\n", fmt::gmtime(ns / 1'000'000'000), ns % 1'000'000'000);
  EXPECT_EQ(changed(sent(at_time, "")), any) << at_time;
  EXPECT_EQ(changed(sent(at_time + "at_s = 0.25\n", "")), later);
}

// Truth is lost from its time 0.3 s on, until a command ends the fault between two truths.
TEST_F(RecordInputs, TheEndOfALossOfTruthIsRepeated) {
  const Config config =
      imu(std::string(udp) + "\nextrapolate_ms = 20",
          std::string(native) + "name = \"a\"\n[[fault]]\ntarget = \"truth\"\nkind = \"lost\"\nat_s = 0.3\n");
  SimulatedRun run(config);
  fly(run);
  bool has_ended = false;
  run.host().on_wait = [&] {
    if (has_ended || run.host().now() < run.at(1.105)) return;
    has_ended = true;
    run.engine().apply(Step::command({.kind = Command::Kind::fault_clear}, run.host().now()));
  };
  const std::vector<std::string> sent = record(run, 1, 3);
  EXPECT_EQ(run.truth_counters().accepted, 200U - 31);
  EXPECT_TRUE(repeat(config) == sent);
}

// A silence begins with every third sample of 10 ms. A heartbeat may leave before that sample.
TEST_F(RecordInputs, FramesBetweenSamplesBeforeAFaultOfTheWireAreRepeated) {
  const Config config = imu(udp,
                            "name = \"a\"\nprotocol = \"canopen\"\nport = \"canfile:x\"\nrate_hz = 100\n"
                            "gyro.max_rad_per_s = 100\naccelerometer.max_m_per_s2 = 1000\ndevice.heartbeat_ms = 37\n"
                            "[[fault]]\ntarget = \"wire\"\nkind = \"silence\"\nat_s = 0.02\nfor_s = 0.01\n"
                            "every_s = 0.03\ntimes = 0\n");
  SimulatedRun run(config);
  for (int k = 0; k < 500; ++k) run.truth(0.505 + 0.01 * k, Swing::truth(at_s(0.01 * k)));
  const std::vector<std::string> sent = record(run, 1, 6);
  EXPECT_GT(sent[0].size(), 200U);
  EXPECT_TRUE(repeat(config) == sent);
}

}  // namespace
}  // namespace imud
