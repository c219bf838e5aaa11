// RackCheck: the configurations of a rack, and what is wrong with them together.
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

// The configurations of all runs of `rack`, which must outlive them, in its order. Throws ConfigError with every
// fault of them. Adds warnings: each describes what is possible, but probably not meant.
std::vector<LoadedRun> load_rack(const Rack& rack, std::vector<std::string>& warnings);

// Reads a rack with its configurations, and prints what would run where. Returns 0. Throws ConfigError.
int rack_check(const std::string& path);

}  // namespace imud
