// Run: one whole run of the emulator, from opening the ports to the closing summary.
#pragma once

#include <optional>
#include <string>

#include "emulator/monitor.hpp"

namespace imud {

struct RunOptions {
  std::optional<double> duration_s;  // host time; simulation time if the truth is a capture
  std::string summary_file;          // for the summary as JSON; empty: none
  Monitor::Options monitor;
};

// Runs until the capture ends, the duration is over, or SIGINT or SIGTERM arrives, and prints the summary. Returns
// the exit code: 0, or 1 if a capture has ended without any accepted truth. Throws PortError if a port cannot be
// opened, std::runtime_error if a file cannot be written.
int run(const Config& config, const RunOptions& options);

}  // namespace imud
