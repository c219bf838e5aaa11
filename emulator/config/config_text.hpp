// ConfigText: the text of a configuration, with the overrides of the command line.
#pragma once

#include <toml++/toml.h>

#include <span>
#include <string>

#include "emulator/ground/table_reader.hpp"

namespace imud {

struct ConfigText {
  toml::table root;
  // The SHA-256, in hexadecimal, of the file, followed by a line for each override if there are any.
  std::string sha256;
};

// Reads the configuration in `path`, a TOML file, a record or - for standard input, then sets each override:
// KEY=VALUE, where KEY is a path such as "truth.port", "imu.0.rate_hz", "imu.NAME.rate_hz" or, for all imus,
// "imu.*.rate_hz", and VALUE is as in TOML; a bare word is text. Where a key takes a text, a bare number, boolean or
// date is text, too (Faults::given_text). Adds a fault for each override that cannot be set. Throws ConfigError if
// the file cannot be read or is no TOML.
ConfigText read_config_text(const std::string& path, std::span<const std::string> overrides, Faults& faults);

// Returns the SHA-256 of the bytes, in hexadecimal.
std::string sha256(const std::string& bytes);

// Returns the table as TOML, without the empty tables in it.
std::string toml_text(toml::table table);

}  // namespace imud
