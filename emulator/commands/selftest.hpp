// Selftest: measures the machine, and prints the timing that can be expected of it.
#pragma once

#include "emulator/plan/config.hpp"

namespace imud {

struct SelftestOptions {
  double measure_s = 2;  // duration of each measurement, above 0
};

// Measures and prints: the lateness of a bare loop at the fastest imu's rate; the duration of writes to each imu's
// port; the lateness of many sensors (measure_rack()). Then prints the lateness, the rate and the number of sensors
// that can be expected, and advice. If the transport of a port has private copies (Transport::has_private_copy), such
// a copy is measured; otherwise frames are sent to the port itself. Only `realtime` and `imus` of `config` are used.
// Throws PortError.
int selftest_timing(const Config& config, const SelftestOptions& options);

// Returns the default configuration for the measurement: one imu at 1 kHz on a pty.
Config selftest_config();

}  // namespace imud
