// RackStatus: the status of all runs of a rack. All hosts are asked at the same time.
#pragma once

#include <atomic>
#include <string>
#include <vector>

#include "emulator/control/json_rpc.hpp"
#include "emulator/rack/host_scripts.hpp"
#include "emulator/rack/rack_hosts.hpp"

namespace imud {

// Asks the hosts. Returns an object with `rack`, `good` (all runs run), `hosts` with their `runs`, and `remarks`
// (differences()).
Json rack_status(const Rack& rack, const std::atomic<bool>& stop);
// Returns the same object from given answers of the hosts.
Json rack_status_of(const Rack& rack, const std::vector<HostAnswer>& answers);

// Returns the status for people.
std::string rack_status_text(const Json& status);

// Prints the status. Returns 0 if all runs run, otherwise 1. Throws ConfigError if the rack's file is wrong.
int show_rack_status(const std::string& path, bool as_json);

}  // namespace imud
