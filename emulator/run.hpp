// Run: one whole run of the emulator, from opened ports to the summary.
#pragma once

#include <optional>
#include <string>

#include "emulator/monitor.hpp"

namespace imud {

struct RunOptions {
  std::optional<double> duration_s;  // host time; simulation time when a capture is the truth
  std::string summary_file;          // JSON; empty: none
  Monitor::Options monitor;
};

// Until the capture ends, the duration is over, or SIGINT or SIGTERM comes. Throws PortError if a port cannot be
// opened, std::runtime_error if a file cannot be written. Returns the exit code.
int run(const Config& config, const RunOptions& options);

}  // namespace imud
