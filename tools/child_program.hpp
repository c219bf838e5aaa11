// Runs other programs: imud, whose configurations and models the tools do not know.
#pragma once

#include <string>
#include <vector>

namespace imud {

// Where the program's standard error goes.
enum class ChildErrors : bool { shown, discarded };

struct ChildResult {
  int exit_code = 0;   // 128 + the signal that ended it
  std::string output;  // standard output
};

// Runs a program to its end with `input` as its whole standard input. The name is searched in PATH unless it has a
// slash. Throws std::runtime_error if it cannot be run.
ChildResult run_child(const std::string& program, const std::vector<std::string>& arguments,
                      const std::string& input = {}, ChildErrors errors = ChildErrors::shown);

// Returns the imud that stands beside this program, as when both are built or installed, or the name, for PATH.
std::string imud_program();

}  // namespace imud
