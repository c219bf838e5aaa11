// A product whose frames leave through a WirePort, sample by sample, into a port that keeps them.
#pragma once

#include <deque>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "emulator/frames/described_protocols.hpp"
#include "emulator/imu/wire_port.hpp"
#include "tests/protocols/recording.hpp"

namespace imud {

// Keeps the frames that are sent to it, and receives the bytes that a test has put into `from_host`.
class KeepingPort final : public Port {
 public:
  void send(std::span<const Frame> frames) noexcept override {
    for (const Frame& frame : frames) {
      if (keeps) kept.push_back({{frame.bytes.begin(), frame.bytes.end()}, frame.can});
      if (refuses)
        ++counters_.dropped;
      else if (holds)
        ++held;
      else
        counters_.count_sent(is_reply_);
    }
  }
  std::optional<Received> receive() noexcept override {
    if (from_host.empty()) return std::nullopt;
    incoming_ = std::move(from_host.front());
    from_host.pop_front();
    ++counters_.received;
    return Received{{incoming_}, {}};
  }
  void flush() noexcept override { counters_.count_sent(false, std::exchange(held, 0)); }
  std::optional<HostTime> next_flush() const noexcept override {
    return held > 0 ? std::optional(HostTime{1}) : std::nullopt;
  }
  void set_connected(bool connected) noexcept override {
    if (keeps) connections.push_back(connected);
  }
  bool set_break(bool on) noexcept override {
    if (keeps) breaks.push_back(on);
    return has_break;
  }

  std::vector<StoredFrame> kept;
  std::deque<std::vector<std::byte>> from_host;
  std::vector<bool> connections, breaks;
  bool keeps = true, has_break = false, refuses = false, holds = false;
  std::uint64_t held = 0;

 private:
  std::vector<std::byte> incoming_;
};

// A fault that acts on the samples first to last.
struct WireWindow {
  WireFault kind;
  std::array<double, FaultKind::max_parameters> parameters = {};
  std::uint64_t first = 10, last = 19;
  std::uint32_t number = 0;
  std::uint64_t occurrence = 0;
  double weight = 1;

  ActiveFault at(std::uint64_t sample) const {
    return {.kind = &wire_fault_kinds()[static_cast<std::size_t>(kind)],
            .number = number,
            .parameters = parameters,
            .weight = weight,
            .since = sample - first,
            .occurrence = occurrence,
            .is_last = sample == last};
  }
};

class WireBench {
 public:
  explicit WireBench(std::string_view name, std::string_view settings = "", double rate = 100, double bit_rate = 0,
                     std::uint64_t seed = 1, std::string_view imu = "imu1")
      : protocol(*resolve_protocol(name)), rate_hz(rate), device_(protocol.make(settings_of(protocol, settings))) {
    auto kept = std::make_unique<KeepingPort>();
    inner = kept.get();
    port.emplace(std::move(kept),
                 WirePort::Line{.imu = imu,
                                .protocol = &protocol,
                                .rate_hz = rate,
                                .uart = device_->uart(),
                                .bit_rate = bit_rate,
                                .seal = make_seal(protocol, settings_of(protocol, settings))},
                 seed);
  }

  // Returns what leaves with each of `samples` samples.
  std::vector<std::vector<StoredFrame>> run(std::span<const WireWindow> windows, std::uint64_t samples) {
    std::vector<std::vector<StoredFrame>> all;
    for (std::uint64_t k = 0; k < samples; ++k) {
      set_active(windows);
      sample_.counter = next_;
      sample_.time = DeviceTime{static_cast<std::int64_t>(static_cast<double>(next_) * 1e9 / rate_hz)};
      sample_.rate = Vector3(0.001 * static_cast<double>(next_), -0.5, 0.25);
      sample_.specific_force = Vector3(0, 1, -9.8);
      frames_->clear();
      device_->sample(sample_, *frames_);
      passed += frames_->frames().size();
      port->send(frames_->frames());
      if (check) check();
      all.push_back(std::exchange(inner->kept, {}));
      ++next_;
    }
    return all;
  }
  // Sets the faults of the next sample.
  void set_active(std::span<const WireWindow> windows) {
    active_.clear();
    for (const WireWindow& window : windows)
      if (next_ >= window.first && next_ <= window.last) active_.push_back(window.at(next_));
    port->set_active(active_);
  }

  const Protocol& protocol;
  const double rate_hz;
  std::optional<WirePort> port;
  KeepingPort* inner = nullptr;
  std::uint64_t passed = 0;     // frames of the device
  std::function<void()> check;  // called after each sample

 private:
  std::unique_ptr<Device> device_;
  std::unique_ptr<FrameBuffer> frames_ = std::make_unique<FrameBuffer>();
  std::vector<ActiveFault> active_;
  Sample sample_;
  std::uint64_t next_ = 0;
};

inline std::vector<std::byte> joined(const std::vector<StoredFrame>& frames) {
  std::vector<std::byte> all;
  for (const StoredFrame& frame : frames) all.insert(all.end(), frame.bytes.begin(), frame.bytes.end());
  return all;
}

}  // namespace imud
