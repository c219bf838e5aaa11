// A STIM300 whose power fails, and the faults of its power.
#pragma once

#include <array>
#include <functional>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "emulator/config/load_config.hpp"
#include "emulator/imu/channel.hpp"
#include "tests/emulator/faults/wire_bench.hpp"
#include "tests/emulator/serve.hpp"

namespace imud {

inline ActiveFault power_fault(std::string_view name, std::uint64_t since, double parameter = 0,
                               std::uint32_t number = 0) {
  for (const FaultKind& kind : power_fault_kinds())
    if (kind.name == name) return {.kind = &kind, .number = number, .parameters = {parameter}, .since = since};
  throw std::runtime_error("no such kind");
}

struct PowerWindow {
  std::string_view name;
  std::uint64_t first, last;
  double parameter = 0;
};

inline std::vector<ActiveFault> active_at(std::span<const PowerWindow> windows, std::uint64_t sample) {
  std::vector<ActiveFault> active;
  for (std::uint32_t i = 0; i < windows.size(); ++i)
    if (const PowerWindow& window = windows[i]; sample >= window.first && sample <= window.last)
      active.push_back(power_fault(window.name, sample - window.first, window.parameter, i));
  return active;
}

// The inclinometers have no noise: their filter of 17 Hz, which settles on the first sample after a start, forgets
// this sample so slowly that their first datagrams would differ between units that start at one sample and at the
// next.
inline constexpr std::string_view powered_unit_config =
    "clock = \"lockstep\"\n[truth]\nport = \"udp:127.0.0.1:9810\"\nformat = \"native\"\n[[imu]]\nname = \"imu1\"\n"
    "protocol = \"stim300\"\nport = \"pty:imu1\"\nbefore_first = \"rest\"\n"
    "inclinometer.velocity_random_walk_m_per_s_per_rt_hr = 0\ninclinometer.bias_minimum_mg = 0\n[imu.device]\n";

// A STIM300 at 2000 Hz whose clock runs with the host's.
class PoweredUnit {
 public:
  PoweredUnit(const std::string& config_path, bool has_faults) {
    const ImuConfig config = load_config(config_path).imus[0];
    channel.emplace(config, 0, 1, [this](const PortUse&) {
      auto port = std::make_unique<KeepingPort>();
      inner = port.get();
      return port;
    });
    if (has_faults) channel->enable_faults(config, 1);
    channel->power_on(HostTime{});
    channel->sensor.clock().start_samples();
  }
  HostTime instant(std::uint64_t k) const { return HostTime{} + channel->sensor.grid().offset(k); }
  // Returns what leaves with the next sample. `meanwhile` is called when the sample is prepared, before its instant.
  std::vector<std::byte> step(std::span<const PowerWindow> windows = {},
                              const std::function<void()>& meanwhile = {}) {
    channel->sensor.sense_at_rest(channel->sensor.grid().nominal_offset(next), next);
    if (!windows.empty()) channel->set_power_faults(active_at(windows, next));
    channel->prepare(std::nullopt, false);
    if (meanwhile) meanwhile();
    channel->encode(channel->prepared);
    channel->transmit();
    ++next;
    return joined(std::exchange(inner->kept, {}));
  }
  // Sends to the unit, and returns its answer.
  std::string ask(std::string_view text) {
    const auto bytes = std::as_bytes(std::span(text));
    inner->from_host.push_back({bytes.begin(), bytes.end()});
    serve(*channel, instant(next));
    std::string answer;
    for (const std::byte byte : joined(std::exchange(inner->kept, {}))) answer += static_cast<char>(byte);
    return answer;
  }

  FaultBook book{{}, false, 1};
  std::optional<Channel> channel;
  KeepingPort* inner = nullptr;
  std::uint64_t next = 0;
};

}  // namespace imud
