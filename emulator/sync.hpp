// Sync: the trigger, PPS and output pins of one imu, as UDP datagrams with time stamps (protocols/sync_datagram.hpp).
#pragma once

#include <array>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "core/time.hpp"
#include "protocols/protocol.hpp"
#include "transports/port.hpp"

namespace imud {

// Ports of the pins; empty: not connected.
struct SyncConfig {
  std::string trigger_port, pps_port, tov_port;
  bool is_connected() const { return !(trigger_port + pps_port + tov_port).empty(); }
};

// An edge with a time waits for the sample at or after it, up to 10 s ahead and 64 at most, in order; one whose time
// is past counts as an edge at the last sample, and one without a time as an edge at the next sample. An edge that is
// further ahead, or one too many, is refused and counted. No function waits or allocates. One thread.
class Sync {
 public:
  using OpenPort = std::function<std::unique_ptr<Port>(std::string_view, const PortSettings&)>;
  Sync(const SyncConfig& config, const OpenPort& open);  // throws PortError

  // Gives the device the edges up to `time`, before its sample of that time, which is stamped `stamp`.
  void deliver_edges(Device& device, TruthTime time, DeviceTime stamp) noexcept;
  // Sends the pulse that follows from the device's last sample, if there is one, in simulation time.
  void send_pulse(const Device& device) noexcept;
  // Discards all edges, those that have come and those that wait: the sensor does not sample the truth now.
  void discard_edges() noexcept;
  // Forgets the last sample: the simulation's time may begin again.
  void begin_run() noexcept { last_.reset(); }
  // The number of edges refused.
  std::uint64_t refused() const noexcept { return refused_; }

 private:
  struct Input {
    std::unique_ptr<Port> port;
    std::array<TruthTime, 64> edges = {};  // those that wait
    std::size_t count = 0;
  };
  void receive(Input& input, TruthTime time) noexcept;
  void deliver(Device& device, void (Device::*edge)(DeviceTime) noexcept, Input& input, TruthTime time,
               DeviceTime stamp) noexcept;

  Input trigger_, pps_;
  std::unique_ptr<Port> tov_;
  std::uint64_t refused_ = 0;
  std::optional<TruthTime> last_;  // time of the last sample
  TruthTime time_;                 // likewise, and its stamp
  DeviceTime stamp_;
};

}  // namespace imud
