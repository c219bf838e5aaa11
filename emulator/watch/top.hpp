// `imud top`: a live view of a run in the terminal.
#pragma once

#include <string>

namespace imud {

// Shows the run of that name, or the only one, until q, SIGINT, SIGTERM or SIGHUP, or until the run ends. Restores
// the terminal in each case. Returns 0; 1 if the run has ended, does not answer or is not found; 2 if standard
// input or output is no terminal, or a terminal of an unknown type; 128 plus the signal's number after SIGTERM or
// SIGHUP.
int top(const std::string& name);

}  // namespace imud
