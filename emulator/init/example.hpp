// The command `imud example`: a configuration to start from.
#pragma once

#include <string>
#include <string_view>

#include "emulator/config/presets.hpp"
#include "protocols/protocol.hpp"
#include "protocols/truth_format.hpp"

namespace imud {

// Prints a configuration with the protocol, truth format, transport or preset called `name`, which `imud check`
// accepts. All of its settings are in it as comments, with their defaults; a # before a key makes it a comment.
// Returns the exit code: 2 if there is no such entry.
int example(const std::string& name);

// Prints the preset called `name`, to be copied into a configuration. Returns the exit code: 2 if there is none.
int example_model(const std::string& name);

// Returns a text as a string of TOML, in quotes.
std::string toml_word(std::string_view text);

// Returns [truth] with a format, all of whose settings are in it as comments. If `port` is empty, the port is an
// example.
std::string truth_text(const TruthFormat& format, const std::string& port = {});

// Returns [[imu]] with a protocol at a port, which begins with the name of a transport. `unit`: the product of the
// protocol (`model` in [imu.device]); empty: the default one. `preset`: the sensor whose errors the imu has,
// or its magnetometer or barometer; nullptr: the product's errors.
std::string imu_text(const Protocol& protocol, const std::string& port, std::string_view unit,
                     const Preset* preset = nullptr);

}  // namespace imud
