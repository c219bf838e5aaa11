// What `imud list` prints.
#pragma once

#include <string>

namespace imud {

// Prints the tables of protocols, truth formats and transports, or, if `name` is not empty, the settings of the
// protocol or truth format of that name. Returns the exit code: 2 if there is none.
int list(const std::string& name);

}  // namespace imud
