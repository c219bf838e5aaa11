// The commands that start and stop the runs of a rack by systemd's instances.
#pragma once

#include <string>

namespace imud {

// Checks the rack as rack_check() does; then on each host imud's version, and each configuration where it will be;
// and only if all of that is good on all hosts, installs the configurations and starts the runs. Prints what was
// done. Returns 0 if all runs have started, 1 if not: the others go on. Throws ConfigError if the rack
// or a configuration is wrong.
int rack_start(const std::string& path);

// Stops the runs on all hosts. Prints what was done. Returns 0 if all have stopped, otherwise 1. Throws ConfigError
// if the rack's file is wrong.
int rack_stop(const std::string& path);

}  // namespace imud
