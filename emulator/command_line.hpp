// The command line of imud: run, replay, check, list.
#pragma once

namespace imud {

// Does what the command line says; returns the exit code: 0 done, 1 failed while running, 2 the command line or the
// configuration is wrong.
int command_line(int argc, const char* const* argv);

}  // namespace imud
