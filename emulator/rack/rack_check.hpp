// RackCheck: reads the configurations of a rack, and finds the faults of each and of all together.
#pragma once

#include <string>
#include <vector>

#include "emulator/plan/config.hpp"
#include "emulator/rack/rack_hosts.hpp"

namespace imud {

// A run with its configuration, as the unit of systemd would run it.
struct LoadedRun {
  const RackHost* host = nullptr;
  const RackRun* run = nullptr;
  Config config;
};

// Returns the configurations of all runs in the order of the rack. `rack` must outlive the result. Throws ConfigError
// with every fault. Adds warnings about settings that are possible, but probably not meant.
std::vector<LoadedRun> load_rack(const Rack& rack, std::vector<std::string>& warnings);

// Reads a rack with its configurations, and prints what would run where. Returns 0. Throws ConfigError.
int rack_check(const std::string& path);

}  // namespace imud
