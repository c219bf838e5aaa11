// The questions of `imud init` at a terminal.
#pragma once

#include "emulator/init/init.hpp"

namespace imud {

// Asks for each option that is empty, and again after an answer that is refused; an empty answer takes the default
// that the question shows. Throws OpenError if standard input ends.
void ask(InitOptions& options);

}  // namespace imud
