// Selftest: measures the machine, and prints the timing that can be expected of it.
#pragma once

#include "emulator/plan/config.hpp"

namespace imud {

struct SelftestOptions {
  double measure_s = 2;  // duration of each measurement, above 0
};

// Prints the lateness of a bare loop at the fastest imu's rate, the duration of writes to each imu's port, the
// lateness of many sensors (measure_rack()), the lateness, the rate and the number of sensors that follow, and
// advice. A port whose transport has a private copy (Transport::has_private_copy) is measured on one; to any other
// port frames are sent. Only `realtime` and `imus` of `config` are used. Throws PortError.
int selftest_timing(const Config& config, const SelftestOptions& options);

// Returns the configuration that is measured by default: one imu at 1 kHz on a pty.
Config selftest_config();

}  // namespace imud
