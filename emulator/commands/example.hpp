// The command `imud example`: a configuration to start from.
#pragma once

#include <string>

namespace imud {

// Prints a configuration with the protocol, truth format, transport or preset called `name`, which `imud check`
// accepts. All of its settings are in it as comments, with their defaults; a # before a key makes it a comment.
// Returns the exit code: 2 if there is no such entry.
int example(const std::string& name);

// Prints the preset called `name`, to be copied into a configuration. Returns the exit code: 2 if there is none.
int example_model(const std::string& name);

}  // namespace imud
