// RunCommands: the commands that ask and change runs that go on: `ctl`, `status`, `top`.
#pragma once

#include <optional>
#include <string>

#include "emulator/control/ctl.hpp"
#include "emulator/watch/status.hpp"

namespace imud {

class RunCommands {
 public:
  // Adds the commands to the command line, which outlives this.
  explicit RunCommands(CLI::App& app);
  // Executes the command that was given, and returns its exit code; nullopt if it is none of these commands.
  std::optional<int> execute() const;

 private:
  CtlOptions ctl_options_;
  StatusOptions status_options_;
  std::string top_name_;
  const CLI::App *ctl_, *status_, *top_;
};

}  // namespace imud
