// Reads a configuration from TOML, and checks it as a whole.
#pragma once

#include <span>
#include <string>

#include "emulator/plan/config.hpp"

namespace imud {

// Reads `path` (- is standard input; of a record the configuration in it), then sets each override, such as
// "imu.0.rate_hz=400" (the value as in TOML; a bare word is text). A `capture` that is not empty replaces truth.port;
// - is standard input. Then regular files of the imus are replaced when the run has ended
// (PortSettings::replaces_file). `scenarios` are files with further [[fault]] and [[expect]]. Throws ConfigError with
// every fault of all files.
Config load_config(const std::string& path, std::span<const std::string> overrides = {},
                   const std::string& capture = {}, std::span<const std::string> scenarios = {});

// Reads a configuration from its text, such as Config::resolved. Throws ConfigError.
Config config_of_text(const std::string& text);

// Returns the errors that a `native` sensor of this rate has with this `model`. Throws ConfigError: its first fault
// is of the key `imu.0.model`; where that leaves no range, others follow.
ImuModel model_named(const std::string& model, double rate_hz);

// Returns the path or the address of a port, which no second port can have; empty if ports share it, or if the system
// chooses it. Several spellings of a path give the same.
std::string exclusive_address(const std::string& port);

// Throws ConfigError if a changed port has the address of an open port: a reload opens new ports before it closes old
// ones. `now`: the present configuration of the run; `next`: the new one.
void check_new_ports(const Config& now, const Config& next);

}  // namespace imud
