// Sync: the trigger, PPS and output pins of one imu, as UDP datagrams with time stamps.
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

// Empty: not connected.
struct SyncConfig {
  std::string trigger_port, pps_port, tov_port;
};

// An edge comes as a datagram: its simulation time, i64 in ns, little-endian; of any other length: at the next
// sample. One of up to 10 s ahead waits for its sample, 64 at most, in order; one that is past counts as the last
// sample's instant. What is further ahead, or one too many, is refused and counted. A pulse of the output pin goes as
// its begin and end, likewise in simulation time.
class Sync {
 public:
  using OpenPort = std::function<std::unique_ptr<Port>(std::string_view, Role)>;
  Sync(const SyncConfig& config, const OpenPort& open);  // throws PortError

  // Before the device's sample of the truth at `time`.
  void tell(Device& device, TruthTime time, DeviceTime stamp) noexcept;
  // After that, with its frames.
  void send(const Device& device) noexcept;
  // The sensor is silent: edges go unheard.
  void ignore() noexcept;
  // The simulation's time may have begun anew.
  void begin_run() noexcept { last_.reset(); }
  std::uint64_t refused() const noexcept { return refused_; }  // edges

 private:
  struct Input {
    std::unique_ptr<Port> port;
    std::array<TruthTime, 64> edges = {};  // that wait
    std::size_t count = 0;
  };
  void tell(Device& device, void (Device::*edge)(DeviceTime) noexcept, Input& input, TruthTime time,
            DeviceTime stamp) noexcept;

  Input trigger_, pps_;
  std::unique_ptr<Port> tov_;
  std::uint64_t refused_ = 0;
  std::optional<TruthTime> last_;  // sample
  double rate_ = 1;                // seconds of the device in one of the simulation
  TruthTime time_;
  DeviceTime stamp_;
};

}  // namespace imud
