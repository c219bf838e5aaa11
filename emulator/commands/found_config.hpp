// The configuration that `imud run` and `imud check` use if the command line names none.
#pragma once

#include <string>

namespace imud {

// Returns the first of these paths at which there is a file: ./imud.toml, $XDG_CONFIG_HOME/imud/imud.toml (without
// this variable ~/.config/imud/imud.toml), /etc/imud/imud.toml. Prints the path to standard error. Throws OpenError,
// which lists the paths, if there is no file.
std::string found_config();

}  // namespace imud
