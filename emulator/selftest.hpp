// Selftest: measures the machine, and says what timing the user can expect of it.
#pragma once

#include <string>

#include "emulator/config.hpp"

namespace imud {

struct SelftestOptions {
  double measure_s = 2;  // each measurement
};

// Prints wake-ups of a bare loop at the fastest imu's rate, writes to each imu's port (pty and file ones by a port of
// the same kind beside it; the others are written to), what follows for lateness and rate, and advice. `config`: with
// realtime and imus only needed. Throws PortError.
int selftest_timing(const Config& config, const SelftestOptions& options);

// What is measured without a configuration: one imu at 1 kHz to a pty.
Config selftest_config();

}  // namespace imud
