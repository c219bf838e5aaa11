// A simulated host, network and sensor ports: events happen exactly at the given instants of a simulated clock.
#pragma once

#include <atomic>
#include <deque>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "emulator/drive/assembly.hpp"
#include "emulator/record/recorder.hpp"
#include "protocols/native_truth.hpp"

namespace imud {

struct Arrival {
  HostTime time;
  std::vector<std::byte> bytes;
};

class SimulatedHost final : public Host {
 public:
  HostTime now() noexcept override { return now_; }
  HostTime sleep_until(HostTime time, Nanoseconds spin) noexcept override {
    spun_ += spin;
    go_to(time);
    return now_;
  }
  Ahead ahead(clockid_t) noexcept override {
    return {epoch_ahead ? epoch_ahead(now_) : Nanoseconds{0}, Nanoseconds{50}};
  }
  void reserve_inputs(std::size_t count) override { inputs_.assign(count, -1); }
  void watch(std::size_t input, int descriptor, short events, bool) noexcept override {
    inputs_[input] = (events & POLLIN) != 0 ? descriptor : -1;
  }
  std::span<const Ready> wait_for_input(HostTime time, Nanoseconds spin) noexcept override {
    HostTime until = time;
    spun_ += spin;
    for (std::size_t i = 0; i < inputs_.size(); ++i) until = std::min(until, readable_at(i));
    go_to(std::max(now_, until));
    ready_.clear();
    for (std::size_t i = 0; i < inputs_.size(); ++i)
      if (readable_at(i) <= now_) ready_.push_back({i, POLLIN});
    if (on_wait) on_wait();
    return ready_;
  }
  // The sum of the times for which the loop was asked to spin.
  Nanoseconds spun() const { return spun_; }
  // Stops the host from `from` until `until`.
  void freeze(HostTime from, HostTime until) { freezes_.push_back({from, until}); }
  void spend(Nanoseconds time) noexcept { go_to(now_ + time); }

  std::function<Nanoseconds(HostTime)> epoch_ahead;  // of the epoch's clock against this host's; nullptr: 0
  std::deque<Arrival> arrivals;                      // of truth, in order
  std::function<HostTime(int fd)> next_input;        // when a sensor's port is readable, or `never`
  static constexpr HostTime never{std::numeric_limits<std::int64_t>::max()};
  std::function<void()> on_wait;          // called at the end of each wait for input
  std::function<void(HostTime)> on_send;  // called before each sample of a SimulatedSensor is sent
  Nanoseconds send_cost{0};               // duration of each send
  HostTime end;
  std::atomic<bool> stop = false;

 private:
  HostTime readable_at(std::size_t input) const {
    if (inputs_[input] < 0) return never;
    if (input == 0) return arrivals.empty() ? never : arrivals.front().time;
    return next_input ? next_input(inputs_[input]) : never;
  }
  void go_to(HostTime time) noexcept {
    now_ = std::max(now_, time);
    for (const auto& [from, until] : freezes_)
      if (now_ >= from && now_ < until) now_ = until;
    if (now_ >= end) stop = true;
  }
  std::vector<int> inputs_;  // descriptors; input 0 is the truth
  std::vector<Ready> ready_;
  HostTime now_{1'000'000'000'000};
  Nanoseconds spun_{0};
  std::vector<std::pair<HostTime, HostTime>> freezes_;
};

// Either truth that arrives at given times and takes a little time to receive, or a capture, which is available at
// once and ends. An arrival without bytes is the end of a connection.
class SimulatedTruth final : public Port {
 public:
  explicit SimulatedTruth(SimulatedHost& host, bool capture = false, Nanoseconds cost = Nanoseconds{2'000})
      : host_(host), capture_(capture), cost_(cost) {}
  void send(std::span<const Frame>) noexcept override {}
  std::optional<Received> receive() noexcept override {
    host_.spend(cost_);
    if (host_.arrivals.empty() || (!capture_ && host_.arrivals.front().time > host_.now())) return std::nullopt;
    newest_ = std::move(host_.arrivals.front());
    host_.arrivals.pop_front();
    if (newest_.bytes.empty()) {
      ++counters_.lost_count;
      return std::nullopt;
    }
    return Received{{newest_.bytes}, host_.now()};
  }
  bool at_end() const noexcept override { return capture_ && host_.arrivals.empty(); }
  int descriptor() const noexcept override { return capture_ ? -1 : 1000; }

 private:
  SimulatedHost& host_;
  const bool capture_;
  const Nanoseconds cost_;
  Arrival newest_;
};

// The frames that were sent, decoded from the native protocol.
struct Left {
  HostTime time;
  Sample sample;
};

class SimulatedSensor final : public Port, private MeasurementSink {
 public:
  SimulatedSensor(SimulatedHost& host, std::vector<Left>& left)
      : host_(host), left_(left), decoder_(find_protocol("native")->make_decoder(Settings())) {}
  void send(std::span<const Frame> frames) noexcept override {
    if (host_.on_send) host_.on_send(host_.now());
    for (const Frame& frame : frames) decoder_->feed(frame, *this);
    counters_.count_sent(is_reply_, frames.size());
    host_.spend(host_.send_cost);
  }
  std::optional<Received> receive() noexcept override { return std::nullopt; }

 private:
  void on_measurement(const Measurement& measurement) override { left_.push_back({host_.now(), measurement.sample}); }
  SimulatedHost& host_;
  std::vector<Left>& left_;
  std::unique_ptr<Decoder> decoder_;
};

// `imud run` in real time with simulated ports. Truth port "udp:...", imu ports "file:NAME".
class SimulatedRun {
 public:
  explicit SimulatedRun(const Config& config) : config_(config) {}

  SimulatedHost& host() { return host_; }
  // Replaces the SimulatedSensor.
  std::function<std::unique_ptr<Port>(SimulatedHost&)> make_sensor;
  // Opens the pins; nullptr: there is none.
  Ports open_pin;
  Recorder* recorder = nullptr;  // started by run()
  RunControl* control = nullptr;
  // Time since the simulation's start.
  HostTime at(double s) const { return begin_ + nanoseconds(s); }
  double since_begin(HostTime time) const { return seconds(time - begin_); }

  // Adds a truth that arrives at `arrival_s`. The calls may be in any order.
  void truth(double arrival_s, const Truth& truth) {
    std::vector<std::byte> bytes(native_truth_size);
    encode_native_truth(truth, std::span<std::byte, native_truth_size>(bytes));
    arrivals_.emplace(at(arrival_s), std::move(bytes));
  }
  void arrival(double arrival_s, std::string_view text) {
    const auto bytes = std::as_bytes(std::span(text));
    arrivals_.emplace(at(arrival_s), std::vector<std::byte>(bytes.begin(), bytes.end()));
  }
  void garbage(double arrival_s) { arrivals_.emplace(at(arrival_s), std::vector<std::byte>(100)); }

  void run(double until_s) {
    for (auto& [time, bytes] : arrivals_) host_.arrivals.push_back({time, std::move(bytes)});
    host_.end = at(until_s);
    left_.resize(config_.imus.size());
    std::size_t next = 0;
    const auto ports = [&](const PortUse& use) {
      if (use.of == PortUse::Of::truth) return std::unique_ptr<Port>(std::make_unique<SimulatedTruth>(host_));
      if (use.of != PortUse::Of::line) return open_pin(use);
      return make_sensor ? make_sensor(host_) : std::make_unique<SimulatedSensor>(host_, left_[next++]);
    };
    StepSink& sink = recorder != nullptr ? *recorder : StepSink::none();
    assembly_.emplace(config_, ports, Assembly::Parts{.sink = sink, .control = control});
    if (recorder != nullptr) recorder->start(true, config_.resolved());
    assembly_->run(host_, host_.stop);
  }

  const std::vector<Left>& left(std::size_t imu = 0) const { return left_[imu]; }
  const ImuCounters& counters(std::size_t imu = 0) { return engine().channels()[imu]->counters; }
  const TruthCounters& truth_counters() { return engine().intake().counters(); }
  const TruthQuality& quality() { return engine().quality(); }
  const ClockCounters& clock() const { return assembly_->clock(); }
  Engine& engine() { return assembly_->engine(); }

 private:
  Config config_;
  SimulatedHost host_;
  HostTime begin_ = host_.now();
  std::multimap<HostTime, std::vector<std::byte>> arrivals_;
  std::vector<std::vector<Left>> left_;
  std::optional<Assembly> assembly_;
};

}  // namespace imud
