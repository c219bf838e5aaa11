// CaptureCheck: finds faults and places that a capture contradicts in the configuration that it is replayed with.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "emulator/config/load_config.hpp"
#include "emulator/plan/config.hpp"

namespace imud {

// The port of a capture that a command line gives.
struct CapturePort {
  // `capture` is a file, a port, - for standard input, or empty. Throws PortError if `config` is standard input, too.
  CapturePort(const std::string& capture, const std::string& config);
  std::string port;      // as load_config() takes it
  bool repeats = false;  // the capture is a record without further words, whose run is repeated
};

// The findings before the capture of a configuration is replayed.
struct CaptureFindings {
  std::vector<std::string> faults;    // each [[fault]] that cannot begin within the capture, unless it is optional
  std::vector<std::string> warnings;  // a place or a date that contradicts [earth]; a run logs them, too
  std::string no_truth;  // why a run has no truth, and the remedy: the capture cannot be read, or has none; or empty
};

// The most truths that are read. A longer capture is taken as long enough for any fault.
inline constexpr std::size_t most_truths_ahead = 500'000;

// Reads the truth of a capture that is a regular file, from its first truth to the first whose time reaches the begin
// of every fault, or to the end. The length runs from the earliest to the latest time, so that no run in the capture
// is longer. Finds nothing if the truth is live, or comes from standard input or a pipe, which only the run may read.
CaptureFindings check_capture(const Config& config);

// The time from the first to the last truth of each run in a capture, summed over the runs.
struct CaptureLength {
  double length_s = 0;
  bool is_whole = true;  // false: the capture is longer, but most_truths_ahead were read
};
// Reads the truth of a capture that is a regular file. Returns a length of 0 s for another capture, or if the file
// cannot be read. A truth begins a run if its time is back by more than a second, or ahead by a gap. A truth that is
// back by less is only out of order.
CaptureLength capture_length(const Config& config);

// Throws ConfigError with the errors that check_capture() has found, if there are any.
void refuse_late_faults(const Config& config);

// A configuration with the capture that it is replayed on.
struct ReplayConfig {
  Config config;
  bool repeats = false;  // CapturePort::repeats
};

// Reads the configuration at `path` for the replay of `capture`, as load_config() and CapturePort do. Throws
// ConfigError also if a fault begins after the capture's end, or if the recorded run to be repeated has had another
// configuration. Changes by `overrides` are intended.
ReplayConfig load_replay(const std::string& path, std::span<const std::string> overrides, const std::string& capture,
                         std::span<const std::string> scenarios = {});

}  // namespace imud
