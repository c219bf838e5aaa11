// check: prints a description of a configuration's run, or the value of every key.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "core/requirement.hpp"
#include "emulator/config/load_config.hpp"

namespace imud {

enum class CheckLayout : std::uint8_t {
  text,  // rates, lines and their loads, warnings, and the whole configuration
  toml,  // the whole configuration
  json,  // all of the above, and the faults
};

struct CheckOptions {
  CheckLayout layout = CheckLayout::text;
  std::span<const Requirement> required;   // limits whose figures must exist
  std::span<const std::string> scenarios;  // as load_config() takes them
  std::string capture;                     // replaces truth.port, as in load_config(); empty: none
  bool repeats = false;                    // the capture is a record, whose run is repeated
};

// Loads a configuration as `imud run` does, and makes all parts of the run on ports that are not opened. If the truth
// is a capture, reads the begin of the capture (check_capture()); an `options.capture` without truth is a fault.
// Prints the result in `options.layout`. Returns the exit code. With the layout json, faults are printed; otherwise
// ConfigError, PortError or RequirementError is thrown.
int check(const std::string& path, std::span<const std::string> overrides, const CheckOptions& options);

}  // namespace imud
