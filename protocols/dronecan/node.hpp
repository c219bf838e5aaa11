// The state of the node that the services report and change (services.cpp), shared with the device (device.cpp).
#pragma once

#include <cstdint>
#include <string>

#include "protocols/dronecan/allocation.hpp"
#include "protocols/dronecan/messages.hpp"
#include "protocols/dronecan/parameters.hpp"

namespace imud::dronecan {

struct Version {
  std::uint8_t major = 0, minor = 0;
};

// The properties of a unit that the host cannot change.
struct Identity {
  UniqueId unique_id = {};
  std::string name;
  Version software, hardware;
  Nanoseconds start_up{};  // time in the mode initialization
};

// Counts since power-on.
struct TransportStatistics {
  std::uint64_t transfers_sent = 0, transfers_received = 0, transfer_errors = 0;
  std::uint64_t frames_sent = 0, frames_received = 0, frame_errors = 0;
};

struct Node {
  Identity identity;
  Memory memory;
  TransportStatistics statistics;
  DeviceTime power_on;        // time of power-on
  unsigned id = anonymous;    // the node id; anonymous: not allocated yet
  Health health = health_ok;  // the worst since the last NodeStatus

  bool is_operational(DeviceTime now) const noexcept { return now - power_on >= identity.start_up; }
  NodeStatusWire status(DeviceTime now) const noexcept {
    const auto mode = is_operational(now) ? operational : initialization;
    return {.uptime_s = little_uint32_buf_t(static_cast<std::uint32_t>((now - power_on) / std::chrono::seconds(1))),
            .state = static_cast<std::uint8_t>(health << 6U | mode << 3U),
            .vendor_code = little_uint16_buf_t(0)};
  }
};

}  // namespace imud::dronecan
