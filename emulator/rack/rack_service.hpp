// The commands that start and stop the runs of a rack by systemd's instances.
#pragma once

#include <string>

namespace imud {

// Checks the rack as rack_check() does. Then checks on each host the version of imud, and each configuration by
// `imud check` in its folder. If there is no fault on any host, installs the configurations and starts the runs.
// Prints the result. Returns 0 if all runs have started, otherwise 1; runs that have started go on. Throws
// ConfigError if the rack or a configuration is wrong.
int rack_start(const std::string& path);

// Stops the runs on all hosts. Prints the result. Returns 0 if all runs have stopped, otherwise 1. Throws ConfigError
// if the rack's file is wrong.
int rack_stop(const std::string& path);

}  // namespace imud
