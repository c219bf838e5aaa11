// CommandOutput: runs another program to its end, and keeps its output.
#pragma once

#include <atomic>
#include <string>
#include <vector>

namespace imud {

struct CommandOutput {
  int exit_code = 0;  // 128 + n if signal n has ended it; 127 if it could not be started
  std::string output;
  std::string errors;  // or why it could not be started
};

// Runs the program words[0], which is found in PATH, with the other words as its arguments: no shell sees them. Its
// standard input is empty. It is in a process group of its own, so that Ctrl-C at the terminal does not reach it; it
// gets SIGTERM if `stop` becomes true.
CommandOutput run_command(const std::vector<std::string>& words, const std::atomic<bool>& stop);

}  // namespace imud
