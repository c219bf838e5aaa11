#include "emulator/rack/rack_commands.hpp"

#include <CLI/CLI.hpp>

#include "emulator/rack/rack_check.hpp"

namespace imud {

RackCommands::RackCommands(CLI::App& app, bool is_given) {
  CLI::App* rack = app.add_subcommand("rack", "Check, start, show and stop the runs of several hosts as one");
  if (!is_given) return;
  rack->require_subcommand(1);
  const auto add = [&](const std::string& name, const std::string& help) {
    CLI::App* command = rack->add_subcommand(name, help);
    command->add_option("RACK", file_, "File of the rack, TOML: which hosts run which configurations")->required();
    return command;
  };
  check_ = add("check", "List every fault of a rack and of its configurations, or show what would run where");
}

std::optional<int> RackCommands::execute() const {
  if (check_ == nullptr) return std::nullopt;
  if (check_->parsed()) return rack_check(file_);
  return std::nullopt;
}

}  // namespace imud
