// The command `imud list`: protocols, truth formats, transports and presets, as their entries describe them.
#pragma once

#include <string>

namespace imud {

// Prints all entries, a line each, or the settings, options and columns of the entries called `name`. With `json`
// the same as JSON. Returns the exit code: 2 if there is no such entry.
int list(const std::string& name, bool json);

}  // namespace imud
