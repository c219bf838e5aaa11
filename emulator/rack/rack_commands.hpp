// RackCommands: the commands `imud rack ...`.
#pragma once

#include <optional>
#include <string>

#include "emulator/web/status_page_options.hpp"

namespace imud {

class RackCommands {
 public:
  // Adds the command `rack` to `app`, which must outlive this. `is_given`: the command line has this command; only
  // then its subcommands are added.
  RackCommands(CLI::App& app, bool is_given);
  // Executes the subcommand of the command line. Returns its exit code; nullopt if the command line has another
  // command. Throws ConfigError if the rack or one of its configurations is wrong.
  std::optional<int> execute() const;

 private:
  std::string file_, output_;
  StatusPageOptions options_;  // of `status`
  const CLI::App *check_ = nullptr, *status_ = nullptr, *start_ = nullptr, *stop_ = nullptr, *record_ = nullptr;
};

}  // namespace imud
