// SyncConfig: where the pins of an imu are connected.
#pragma once

#include <string>

namespace imud {

// The ports of the pins; an empty one is not connected.
struct SyncConfig {
  std::string trigger_port, pps_port, tov_port;
  bool is_connected() const { return !(trigger_port + pps_port + tov_port).empty(); }
};

}  // namespace imud
