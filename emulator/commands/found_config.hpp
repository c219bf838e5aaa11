// The configuration that `imud run` and `imud check` take if the command line names none.
#pragma once

#include <string>

namespace imud {

// Returns the first of these that is a file: ./imud.toml, $XDG_CONFIG_HOME/imud/imud.toml (without that variable
// ~/.config/imud/imud.toml) and /etc/imud/imud.toml. Prints it to standard error. Throws OpenError, which names the
// places, if there is none.
std::string found_config();

}  // namespace imud
