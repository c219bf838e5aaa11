// RackCommands: the commands `imud rack ...`.
#pragma once

#include <optional>
#include <string>

#include "emulator/web/status_page_options.hpp"

namespace imud {

class RackCommands {
 public:
  // Adds the command to the command line, which outlives this, and if it is given, the commands below it.
  RackCommands(CLI::App& app, bool is_given);
  // Executes the command that was given, and returns its exit code; nullopt: another one was given. Throws
  // ConfigError if the rack or one of its configurations is wrong.
  std::optional<int> execute() const;

 private:
  std::string file_, output_;
  StatusPageOptions options_;  // of `status`
  const CLI::App *check_ = nullptr, *status_ = nullptr, *start_ = nullptr, *stop_ = nullptr, *record_ = nullptr;
};

}  // namespace imud
