// The command line of imud: run, replay, check, selftest, list.
#pragma once

namespace imud {

// Executes the command line. Returns the exit code: 0 done, 1 failed while running, 2 the command line or the
// configuration is wrong, 3 the run is incomplete or breaks a limit of `--require`.
int command_line(int argc, const char* const* argv);

}  // namespace imud
