// CommandOutput: runs other programs to their end, and keeps their output.
#pragma once

#include <atomic>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/time.hpp"

namespace imud {

struct CommandOutput {
  int exit_code = 0;     // 128 + n if signal n has ended it; 127 if it could not be started
  bool is_late = false;  // the command was ended after the time limit
  std::string output;
  std::string errors;  // the standard error, or why the command could not be started
};

// Runs the program words[0], which is found in PATH, with the other words as its arguments: no shell sees them. Its
// standard input is empty. It is in a process group of its own, so that Ctrl-C at the terminal does not reach it; it
// gets SIGTERM if `stop` becomes true.
CommandOutput run_command(const std::vector<std::string>& words, const std::atomic<bool>& stop);

struct ProgramCall {
  std::vector<std::string> words;
  std::string input;  // its whole standard input
  // Receives the standard output piece by piece, instead of CommandOutput::output. Empty: it is kept.
  std::function<void(std::string_view)> receive = nullptr;
};

// Runs all at the same time, each as above, and returns their outputs in the same order. Programs that still run
// after `limit` are killed, with all that they have started. Output that a child of a program writes after the
// program has ended is not waited for: the connection that ssh keeps for later calls (ControlPersist) holds its
// standard error.
std::vector<CommandOutput> run_commands(std::span<const ProgramCall> calls, std::optional<Nanoseconds> limit,
                                        const std::atomic<bool>& stop);

}  // namespace imud
