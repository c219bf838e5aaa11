// The order of a device's calls, and how the loop waits and spins; on a simulated host.
#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <deque>
#include <map>

#include "tests/emulator/run/realtime_test.hpp"

namespace imud {
namespace {

using namespace std::chrono_literals;

// A device that records its calls, and has a deadline every 70 ms.
class Diary final : public Device {
 public:
  struct Entry {
    char call;  // o: power on, s: sample, r: receive, p: poll, c: clock step, t: trigger
    DeviceTime time;
  };
  static std::vector<Entry> entries;
  static std::function<void()> on_sample, on_power_on;

  void power_on(DeviceTime now) noexcept override {
    add('o', now);
    if (on_power_on) on_power_on();
    next_ = now + period;
  }
  void sample(const Sample& sample, FrameBuffer& out) noexcept override {
    add('s', sample.time);
    frame('s', out);
    if (on_sample) on_sample();
  }
  void receive(const Frame&, DeviceTime now, FrameBuffer& replies) noexcept override {
    add('r', now);
    frame('r', replies);
  }
  std::optional<DeviceTime> deadline() const noexcept override { return next_; }
  void poll(DeviceTime now, FrameBuffer& out) noexcept override {
    add('p', now);
    frame('p', out);
    next_ = next_ + period;
  }
  void step_clock(Nanoseconds by) noexcept override {
    add('c', DeviceTime{by.count()});
    next_ = next_ + by;
  }
  void trigger(DeviceTime time) noexcept override { add('t', time); }

 private:
  static constexpr Nanoseconds period{70'000'000};
  static void add(char call, DeviceTime time) { entries.push_back({call, time}); }
  static void frame(char letter, FrameBuffer& out) {
    out.room(1)[0] = static_cast<std::byte>(letter);
    out.push(1);
  }
  DeviceTime next_ = DeviceTime{} + period;
};
std::vector<Diary::Entry> Diary::entries;
std::function<void()> Diary::on_sample, Diary::on_power_on;

constexpr Protocol diary_protocol = {
    .name = "diary",
    .summary = "",
    .link = Link::bytes,
    .document = "",
    .settings = {},
    .has_sync_pins = true,
    .make = [](const Settings&) -> std::unique_ptr<Device> { return std::make_unique<Diary>(); },
    .make_decoder = [](const Settings&) -> std::unique_ptr<Decoder> { return nullptr; },
};

// Runs the device; returns the frames with their times. `input` is what the host writes, and when.
struct DiaryPort final : Port {
  DiaryPort(SimulatedHost& host_, std::vector<std::pair<HostTime, char>>& sent_, std::deque<HostTime> input_)
      : host(host_), sent(sent_), input(std::move(input_)) {}
  void send(std::span<const Frame> frames) noexcept override {
    for (const Frame& frame : frames) sent.emplace_back(host.now(), static_cast<char>(frame.bytes[0]));
    counters_.count_sent(is_reply_, frames.size());
    if (on_send) on_send();
  }
  std::optional<Received> receive() noexcept override {
    if (input.empty() || input.front() > host.now()) return std::nullopt;
    const HostTime arrival = input.front();
    input.pop_front();
    return Received{{byte}, arrival};
  }
  int descriptor() const noexcept override { return is_waited_for ? 1001 : -1; }
  SimulatedHost& host;
  std::vector<std::pair<HostTime, char>>& sent;
  std::deque<HostTime> input;
  bool is_waited_for = false;
  std::function<void()> on_send;
  std::array<std::byte, 1> byte{};
};

// Returns a port that the host waits for, so that its input ends a wait.
std::unique_ptr<DiaryPort> waited_port(SimulatedHost& host, std::vector<std::pair<HostTime, char>>& sent,
                                       const std::deque<HostTime>& input) {
  auto all = std::make_unique<DiaryPort>(host, sent, input);
  all->is_waited_for = true;
  host.next_input = [port = all.get()](int) {
    return port->input.empty() ? SimulatedHost::never : port->input.front();
  };
  return all;
}

class LoopTest : public RealtimeTest {
 protected:
  static constexpr const char* a_capture = "pcap:flight.pcap?port=9810";  // which is not opened

  Config diary_config(const std::string& truth, const std::string& imu, double rate_hz = 100) {
    Config c = config(rate_hz, truth, imu);
    c.imus[0].protocol = &diary_protocol;
    Diary::entries.clear();
    Diary::on_sample = Diary::on_power_on = nullptr;
    return c;
  }
  static void expect_increasing_times() {
    DeviceTime last{};
    std::size_t checked = 0;
    for (const Diary::Entry& entry : Diary::entries) {
      if (entry.call == 'c') {
        last = last + Nanoseconds(entry.time.ns);
        continue;
      }
      ASSERT_GE(entry.time, last) << entry.call << ' ' << checked;
      last = entry.time;
      ++checked;
    }
    EXPECT_GT(checked, 100U);
  }
  static std::size_t count(char call) {
    return static_cast<std::size_t>(
        std::ranges::count_if(Diary::entries, [call](const auto& entry) { return entry.call == call; }));
  }
};

// With input from every source, and after the host was stopped for a while, the device's time never decreases, and
// each deadline is polled at its time.
TEST_F(LoopTest, ADevicesTimesIncrease) {
  for (const std::string before : {"silence", "rest"}) {
    SimulatedRun run(diary_config("delay_ms = 20", "before_first = \"" + before + "\"\nclock_error_ppm = 5000"));
    std::vector<std::pair<HostTime, char>> sent;
    std::deque<HostTime> input;
    for (int i = 0; i < 1400; ++i) input.push_back(run.at(0.0028 * i));
    run.make_sensor = [&](SimulatedHost& host) { return std::make_unique<DiaryPort>(host, sent, input); };
    for (int k = 0; k <= 250; ++k) run.truth(1.5 + 0.01 * k, Swing::truth(TruthTime{10'000'000 * std::int64_t{k}}));
    run.host().freeze(run.at(2.5), run.at(2.8));
    run.run(4);
    expect_increasing_times();
    EXPECT_EQ(count('o'), 1U) << before;
    EXPECT_EQ(count('c'), before == "silence" ? 1U : 0U);
    EXPECT_NEAR(static_cast<double>(count('r')), 1390, 20);
    EXPECT_NEAR(static_cast<double>(count('p')), 4 / 0.07, 2);
    EXPECT_NEAR(static_cast<double>(count('s')), before == "silence" ? 248 : 400, 6);
    // Each deadline is 70 ms of the device's clock after the one before.
    DeviceTime due{};
    for (const Diary::Entry& entry : Diary::entries) {
      if (entry.call == 'c') due = due + Nanoseconds(entry.time.ns);
      if (entry.call != 'p') continue;
      due = due + 70ms;
      ASSERT_EQ(entry.time, due);
    }
    // Frames that the device sends on its own are transmitted at that time of the host's clock.
    HostTime last{};
    std::size_t even = 0;
    for (const auto& [time, letter] : sent) {
      if (letter != 'p') continue;
      even += std::abs(seconds(time - std::exchange(last, time)) - 0.07 / 1.005) < 2.5e-3;
    }
    EXPECT_GE(even, count('p') - 8) << "all but those of the hold-up";
  }
}

// A sample is prepared up to 2 ms before its instant. Until then the device does not receive it, so that what the
// host sends is executed before it, at its own time, and answered before it.
TEST_F(LoopTest, ACommandThatArrivesBeforeAnInstantIsExecutedBeforeItsSample) {
  SimulatedRun run(diary_config("", "before_first = \"rest\""));
  std::vector<std::pair<HostTime, char>> sent;
  std::deque<HostTime> input;
  constexpr std::array<Nanoseconds, 5> ahead = {3ms, 1ms, 100us, 10us, 1us};
  for (int i = 0; i < 200; ++i) input.push_back(run.at(1.001 + 0.01 * i) - ahead[static_cast<std::size_t>(i) % 5]);
  const std::deque<HostTime> commands = input;
  run.make_sensor = [&](SimulatedHost& host) { return waited_port(host, sent, input); };
  run.run(4);
  ASSERT_EQ(count('r'), 200U);
  expect_increasing_times();
  std::size_t commanded = 0, frame = 0;
  for (std::size_t i = 0; i < Diary::entries.size(); ++i) {
    const auto& [call, time] = Diary::entries[i];
    if (call == 's' || call == 'r' || call == 'p') {
      ASSERT_EQ(sent[frame++].second, call) << "frames leave in the order of the calls";
    }
    if (call != 'r') continue;
    const HostTime written = commands[commanded++];
    EXPECT_EQ(sent[frame - 1].first, written);
    EXPECT_EQ(time - DeviceTime{}, written - run.at(0.001)) << "power comes on at 1 ms";
  }
}

// A reply takes the time from the arrival of the command to the end of the write.
TEST_F(LoopTest, RepliesAreMeasuredByTheHostsClock) {
  SimulatedRun run(diary_config("", "before_first = \"rest\""));
  std::vector<std::pair<HostTime, char>> sent;
  std::deque<HostTime> input;
  for (int i = 0; i < 99; ++i) input.push_back(run.at(0.503 + 0.02 * i));
  input.push_back(run.at(2.6));
  run.make_sensor = [&](SimulatedHost& host) {
    auto port = waited_port(host, sent, input);
    port->on_send = [&host] { host.spend(40us); };
    return port;
  };
  run.host().freeze(run.at(2.5), run.at(2.8));
  run.run(4);
  const DurationHistogram replies = run.counters().reply;
  EXPECT_EQ(replies.count(), 100U);
  EXPECT_NEAR(replies.percentile(50), 40e-6, 1e-6);
  EXPECT_NEAR(replies.percentile(99), 40e-6, 1e-6);
  EXPECT_NEAR(replies.max(), 0.2, 0.01) << "the host was stopped when it arrived";
}

// In lockstep the wait for truth serves the hosts. Where truth has come already, nothing waits.
TEST_F(LoopTest, InLockstepHostsAreServedBetweenTruthsThatHaveCome) {
  Config c = diary_config("", "", 1000);
  c.clock = ClockMode::lockstep;
  SimulatedRun run(c);
  for (int k = 0; k <= 1000; ++k) run.truth(0.001, Swing::truth(TruthTime{1'000'000 * std::int64_t{k}}));
  std::vector<std::pair<HostTime, char>> sent;
  std::deque<HostTime> input;
  for (int i = 0; i < 50; ++i) input.push_back(run.at(0.01 + 0.0011 * i));
  const std::deque<HostTime> commands = input;
  run.make_sensor = [&](SimulatedHost& host) {
    auto port = waited_port(host, sent, input);
    port->on_send = [&host] { host.spend(100us); };
    return port;
  };
  run.run(1);
  EXPECT_EQ(count('s'), 1001U);
  ASSERT_EQ(count('r'), 50U);
  std::size_t commanded = 0;
  for (const auto& [time, call] : sent) {
    if (call != 'r') continue;
    EXPECT_LT(time - commands[commanded++], 150us) << "before the next sample but one";
  }
  EXPECT_EQ(commanded, 50U);
}

TEST_F(LoopTest, PowerGoesOffAndOnBetweenTwoSamplesOnly) {
  SimulatedRun run(diary_config("delay_ms = 20", "", 1000));
  std::vector<std::pair<HostTime, char>> sent;
  run.make_sensor = [&](SimulatedHost& host) {
    auto port = std::make_unique<DiaryPort>(host, sent, std::deque<HostTime>{});
    // While the port is written to, the next samples of the same instant are prepared.
    port->on_send = [&, n = 0]() mutable {
      if (++n % 100 == 0) run.engine().power_cycle.make();
    };
    return port;
  };
  for (int k = 0; k <= 300; ++k) run.truth(0.1 + 0.01 * k, Swing::truth(TruthTime{10'000'000 * std::int64_t{k}}));
  run.run(3);
  EXPECT_NEAR(static_cast<double>(count('o')), 29, 2);
  expect_increasing_times();
}

// At 100 Hz the thread waits for the instant after the sample is prepared.
TEST_F(LoopTest, PowerStaysOnFromThePreparationOfASampleToItsTransmission) {
  SimulatedRun run(diary_config("delay_ms = 20", "", 100));
  std::vector<std::pair<HostTime, char>> sent;
  run.make_sensor = [&](SimulatedHost& host) {
    return std::make_unique<DiaryPort>(host, sent, std::deque<HostTime>{});
  };
  std::vector<std::size_t> transmitted;  // samples, at each power-on
  const auto samples_sent = [&] {
    return static_cast<std::size_t>(
        std::count_if(sent.begin(), sent.end(), [](const auto& frame) { return frame.second == 's'; }));
  };
  Diary::on_sample = [&, n = std::size_t{0}]() mutable {
    EXPECT_EQ(samples_sent(), n) << "the sample before is transmitted";
    if (++n % 10 == 0) run.engine().power_cycle.make();
  };
  Diary::on_power_on = [&] { transmitted.push_back(samples_sent()); };
  for (int k = 0; k <= 300; ++k) run.truth(0.1 + 0.01 * k, Swing::truth(TruthTime{10'000'000 * std::int64_t{k}}));
  run.run(3);
  ASSERT_GT(transmitted.size(), 20U);
  for (std::size_t i = 1; i < transmitted.size(); ++i) EXPECT_EQ(transmitted[i], 10 * i);
}

TEST_F(LoopTest, EdgesThatComeWhileTheSensorIsSilentAreDiscarded) {
  Config c = diary_config("delay_ms = 20\nextrapolate_ms = 50\nwhen_stopped = \"silence\"", "");
  c.imus[0].sync.trigger_port = "udp:127.0.0.1:9811";
  SimulatedHost host;
  const HostTime begin = host.now();
  std::vector<std::pair<HostTime, char>> sent;
  std::deque<HostTime> edges = {begin + 500ms, begin + 1500ms, begin + 2500ms};
  for (int k = 0; k <= 300; ++k) {
    if (k > 100 && k < 200) continue;
    std::vector<std::byte> bytes(native_truth_size);
    encode_native_truth(Swing::truth(TruthTime{10'000'000 * std::int64_t{k}}),
                        std::span<std::byte, native_truth_size>(bytes));
    host.arrivals.push_back({begin + nanoseconds(0.01 * k), std::move(bytes)});
  }
  host.end = begin + 3s;
  Assembly assembly(c, [&](const PortUse& use) -> std::unique_ptr<Port> {
    if (use.of == PortUse::Of::trigger) return std::make_unique<DiaryPort>(host, sent, edges);
    if (use.of == PortUse::Of::truth) return std::make_unique<SimulatedTruth>(host);
    return std::make_unique<DiaryPort>(host, sent, std::deque<HostTime>{});
  });
  assembly.run(host, host.stop);
  EXPECT_GT(assembly.engine().channels()[0]->counters.silent, 80U);
  EXPECT_EQ(count('t'), 2U) << "those of 0.5 s and 2.5 s";
}

// In lockstep the loop spins at the begin of each wait for truth, elsewhere before each instant.
TEST_F(LoopTest, SpinsAsLongAsConfigured) {
  for (const auto& run :
       {std::pair{ClockMode::realtime, false}, {ClockMode::realtime, true}, {ClockMode::lockstep, false}}) {
    const ClockMode clock = run.first;
    const bool capture = run.second;
    Config c = config(200, "delay_ms = 20");
    SimulatedHost host;
    const HostTime begin = host.now();
    host.end = begin + 2s;
    for (int k = 0; k <= 300; ++k) {
      std::vector<std::byte> bytes(native_truth_size);
      encode_native_truth(Swing::truth(TruthTime{10'000'000 * std::int64_t{k}}),
                          std::span<std::byte, native_truth_size>(bytes));
      host.arrivals.push_back({begin + nanoseconds(0.01 * k), std::move(bytes)});
    }
    std::vector<std::pair<HostTime, char>> sent;
    c.clock = clock;
    c.realtime.spin = 150us;
    if (capture) c.truth.port = a_capture;
    Assembly(c, [&](const PortUse& use) -> std::unique_ptr<Port> {
      if (use.of == PortUse::Of::truth) return std::make_unique<SimulatedTruth>(host, capture);
      return std::make_unique<DiaryPort>(host, sent, std::deque<HostTime>{});
    }).run(host, host.stop);
    ASSERT_GT(sent.size(), 350U);
    const std::size_t spins = clock == ClockMode::lockstep ? 300 : sent.size() - 2;
    EXPECT_GE(host.spun(), 150us * spins) << static_cast<int>(clock) << capture;
  }
}

// The second run of a capture begins when its first truth is read, not when the first run began.
TEST_F(LoopTest, EachRunOfAPacedCaptureHasItsOwnBegin) {
  Config c = config(100, "");
  SimulatedHost host;
  const HostTime begin = host.now();
  host.end = begin + 100s;
  for (int run = 0; run < 2; ++run)
    for (int k = 0; k <= 150; ++k) {
      Truth truth = Swing::truth(TruthTime{10'000'000 * std::int64_t{k}});
      truth.new_run = k == 0;
      std::vector<std::byte> bytes(native_truth_size);
      encode_native_truth(truth, std::span<std::byte, native_truth_size>(bytes));
      host.arrivals.push_back({begin, std::move(bytes)});
    }
  std::vector<std::pair<HostTime, char>> sent;
  c.truth.port = a_capture;
  Assembly(c, [&](const PortUse& use) -> std::unique_ptr<Port> {
    if (use.of == PortUse::Of::truth) return std::make_unique<SimulatedTruth>(host, true, 0ns);
    return std::make_unique<DiaryPort>(host, sent, std::deque<HostTime>{});
  }).run(host, host.stop);
  ASSERT_EQ(sent.size(), 302U);
  for (std::size_t k = 1; k < sent.size(); ++k) {
    const Nanoseconds step = sent[k].first - sent[k - 1].first;
    if (k == 151) {
      EXPECT_LT(step, 1ms);
    } else {
      EXPECT_EQ(step, 10ms) << k;
    }
  }
}

// Bad datagrams that arrive faster than they can be decoded delay the samples little, from the first one on.
TEST_F(LoopTest, AFloodFasterThanTheLoopDelaysFewSamples) {
  SimulatedRun run(config(1000, ""));
  for (int k = 0; k <= 200; ++k) run.truth(0.1 + 0.01 * k, Swing::truth(TruthTime{10'000'000 * std::int64_t{k}}));
  for (int i = 0; i < 600'000; ++i) run.garbage(0.5 + 1e-6 * i);
  run.run(2.1);
  ASSERT_GT(run.left().size(), 1990U);
  EXPECT_LT(run.counters().missed, 20U);
}

// A sensor far behind fast truth: the timeline keeps the truths that the sensor still needs; the others wait in the
// port.
TEST_F(LoopTest, TruthWaitsWhileTheTimelineIsFull) {
  SimulatedRun run(config(100, "delay_ms = 1000"));
  for (int k = 0; k <= 8000; ++k) {
    Truth truth = Swing::truth(TruthTime{std::int64_t{500'000} * k});
    truth.sequence = static_cast<std::uint32_t>(k);
    run.truth(0.1 + 0.0005 * k, truth);
  }
  run.run(4);
  ASSERT_GT(run.left().size(), 280U);
  EXPECT_EQ(run.counters().extrapolated, 0U);
  for (const auto& r : navigate(run.left(), 0)) {
    ASSERT_LE(r.time_s, run.since_begin(r.host) - 1.1 + 1e-3);  // later: truth that waits arrives late
    ASSERT_NEAR(r.angle, Swing::angle(r.time_s), 1e-6);
  }
}

// More truths between two samples than the timeline keeps, where truth paces: the slow imu is advanced in between.
// The other definitions of increments are differences of two states, and need no truth between them.
TEST_F(LoopTest, ASlowSensorUsesAllOfAFastCapture) {
  Config c = config(0.5, "", "increments.delta_angle = \"integral\"");
  SimulatedHost host;
  host.end = host.now() + 100s;
  for (int k = 0; k <= 12'000; ++k) {
    Truth truth = Swing::truth(TruthTime{std::int64_t{1'000'000} * k});
    truth.sequence = static_cast<std::uint32_t>(k);
    std::vector<std::byte> bytes(native_truth_size);
    encode_native_truth(truth, std::span<std::byte, native_truth_size>(bytes));
    host.arrivals.push_back({host.now(), std::move(bytes)});
  }
  std::vector<Left> left;
  c.clock = ClockMode::fast;
  Assembly(c, [&](const PortUse& use) -> std::unique_ptr<Port> {
    if (use.of == PortUse::Of::truth) return std::make_unique<SimulatedTruth>(host, true);
    return std::make_unique<SimulatedSensor>(host, left);
  }).run(host, host.stop);
  ASSERT_EQ(left.size(), 7U);
  for (const auto& r : navigate(left, 0)) EXPECT_NEAR(r.angle, Swing::angle(r.time_s), 1e-9);
}

// The time stamps are one nominal period apart in every mode, whatever the clock error: here the sensor's clock is
// one per cent fast.
TEST_F(LoopTest, AStampIsANominalPeriodLaterInFastToo) {
  Config c = config(100, "", "clock_error_ppm = 10000");
  SimulatedHost host;
  host.end = host.now() + 100s;
  for (int k = 0; k <= 100; ++k) {
    std::vector<std::byte> bytes(native_truth_size);
    encode_native_truth(Swing::truth(TruthTime{5'000'000'000 + std::int64_t{10'000'000} * k}),
                        std::span<std::byte, native_truth_size>(bytes));
    host.arrivals.push_back({host.now(), std::move(bytes)});
  }
  std::vector<Left> left;
  c.clock = ClockMode::fast;
  Assembly(c, [&](const PortUse& use) -> std::unique_ptr<Port> {
    if (use.of == PortUse::Of::truth) return std::make_unique<SimulatedTruth>(host, true);
    return std::make_unique<SimulatedSensor>(host, left);
  }).run(host, host.stop);
  ASSERT_EQ(left.size(), 102U) << "101 a second";
  for (std::size_t k = 0; k < left.size(); ++k) {
    EXPECT_EQ(left[k].sample.time.ns, 5'000'000'000 + static_cast<std::int64_t>(k) * 10'000'000);
    const double true_s = 5 + 0.01 / 1.01 * static_cast<double>(k);
    EXPECT_NEAR(left[k].sample.rate.z(), Swing::truth(TruthTime{} + nanoseconds(true_s)).omega_BN_B.z(), 1e-4);
  }
}

// Spinning for longer than, as long as and shorter than the wait neither prolongs the wait nor misses an input. A
// stall of the machine is shorter than 30 s.
TEST(MonotonicHost, FindsInputsWhileItSpins) {
  std::array<int, 2> ends{};
  ASSERT_EQ(::pipe2(ends.data(), O_CLOEXEC), 0);
  const FileDescriptor out(ends[0]), in(ends[1]);
  MonotonicHost host;
  host.reserve_inputs(1);
  host.watch(0, out.get(), POLLIN, false);
  for (const Nanoseconds spin : {Nanoseconds(60s), Nanoseconds(2ms), Nanoseconds(1ms)}) {
    const HostTime until = host.now() + 2ms;
    EXPECT_TRUE(host.wait_for_input(until, spin).empty());
    EXPECT_GE(host.now(), until);
    EXPECT_LT(host.now(), until + 30s);
  }
  ASSERT_EQ(::write(in.get(), "x", 1), 1);
  const HostTime begin = host.now();
  for (const HostTime until : {begin + 60s, HostTime{}})
    EXPECT_EQ(host.wait_for_input(until, 60s).size(), 1U) << "also of a wait that has ended";
  EXPECT_LT(host.now(), begin + 30s);
}

}  // namespace
}  // namespace imud
