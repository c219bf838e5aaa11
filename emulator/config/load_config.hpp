// Reads a configuration from TOML, and checks it as a whole.
#pragma once

#include <span>
#include <string>

#include "emulator/plan/config.hpp"

namespace imud {

// Reads the configuration in `path`, a TOML file, a record or - for standard input, then sets each override, such
// as "imu.0.rate_hz=400" (the value as in TOML; a bare word is text). If `capture` is not empty, it replaces
// truth.port (- is standard input), and regular files of the imus are replaced when the run has ended
// (PortSettings::replaces_file). `scenarios` are files with further [[fault]] and [[expect]]. Throws ConfigError
// with every fault of all files.
Config load_config(const std::string& path, std::span<const std::string> overrides = {},
                   const std::string& capture = {}, std::span<const std::string> scenarios = {});

// Reads a configuration from its text, such as Config::resolved. Throws ConfigError.
Config config_of_text(const std::string& text);

// Returns the errors that a `native` sensor of this rate has with this `model`. Throws ConfigError, whose first
// fault is about the key `imu.0.model`; further faults follow if the sensors then have no range.
ImuModel model_named(const std::string& model, double rate_hz);

// Returns the path or the address of a port if no second port can have the same; empty if several ports can share
// the address, or if the system chooses it. All spellings of a path give the same result.
std::string exclusive_address(const std::string& port);

// Throws ConfigError if a changed port has the address of an open port: a reload opens new ports before it closes old
// ones. `now`: the present configuration of the run; `next`: the new one.
void check_new_ports(const Config& now, const Config& next);

}  // namespace imud
