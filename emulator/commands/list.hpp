// The command `imud list`: protocols, truth formats, transports and presets, as their entries describe them.
#pragma once

#include <string>

namespace imud {

// Prints a line for each entry or, if `name` is not empty, the settings, options and columns of the entries of this
// name. If `json`, prints the same as JSON. Returns the exit code: 2 if there is no such entry.
int list(const std::string& name, bool json);

}  // namespace imud
