// What `imud check` prints.
#pragma once

#include <string>

#include "emulator/config.hpp"

namespace imud {

// Prints what a configuration would run: rates, lines and their loads, and warnings. `path` is the file that it was
// read from. Returns the exit code.
int check(const std::string& path, const Config& config);

}  // namespace imud
