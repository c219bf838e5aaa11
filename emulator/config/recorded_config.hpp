// Reads the configuration that a record contains.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "emulator/plan/config.hpp"

namespace imud {

// Returns the configuration in a record, TOML with the value of every key; nullopt if the file is no record. Empty
// if the record contains no configuration.
std::optional<std::string> recorded_config(const std::string& path);

// Returns a line for each key of `config` whose value differs in the recorded run, `recorded`. Ports of truth and
// imus, their pace, the clock and [realtime] may differ: they do not change the samples. Each imu is compared with
// the recorded imu of its name, if there is one.
std::vector<std::string> differences(const Config& config, const Config& recorded);

}  // namespace imud
