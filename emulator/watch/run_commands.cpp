#include "emulator/watch/run_commands.hpp"

#include <CLI/CLI.hpp>

#include "emulator/watch/top.hpp"

namespace imud {

RunCommands::RunCommands(CLI::App& app) : ctl_(add_ctl_command(app, ctl_options_)) {
  CLI::App* status = app.add_subcommand("status", "Show what runs on this machine, since when, with its figures");
  status->add_option("NAME", status_options_.name, "Only the run of this name ([control] name), or process number");
  status->add_flag("--json", status_options_.json, "As JSON");
  status->footer(
      "Exit codes: 0 a run has answered, and none is silent; 1 no run was found, or one does not answer; 2 the "
      "command line is wrong.");
  status_ = status;
  CLI::App* top = app.add_subcommand("top", "Show a run live in the terminal; q quits, f begins a fault");
  top->add_option("NAME", top_name_,
                  "The name of the run ([control] name), or its process number; else the only one");
  top_ = top;
}

std::optional<int> RunCommands::execute() const {
  if (ctl_->parsed()) return ctl(ctl_options_);
  if (status_->parsed()) return show_status(status_options_);
  if (top_->parsed()) return top(top_name_);
  return std::nullopt;
}

}  // namespace imud
