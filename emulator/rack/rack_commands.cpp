#include "emulator/rack/rack_commands.hpp"

#include <CLI/CLI.hpp>

#include "emulator/rack/rack_check.hpp"
#include "emulator/rack/rack_page.hpp"
#include "emulator/rack/rack_record.hpp"
#include "emulator/rack/rack_service.hpp"
#include "emulator/rack/rack_status.hpp"

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
  CLI::App* status = add("status", "Show what runs on the hosts of a rack, and what differs between them");
  options_.add_to(*status);
  status->footer(
      "Exit codes: 0 all runs of the rack run; 1 one does not, or a host was not reached; 2 the rack is wrong.");
  status_ = status;
  const char* exit_codes = "Exit codes: 0 all has been done on all hosts; 1 it has not; 2 the rack is wrong.";
  CLI::App* start =
      add("start", "Check the rack on all hosts, install its configurations and start its runs, or start none");
  start->footer(exit_codes);
  start_ = start;
  CLI::App* stop = add("stop", "Stop the runs of a rack on all hosts");
  stop->footer(exit_codes);
  stop_ = stop;
  CLI::App* record = add("record", "Merge the records of a rack's runs by time to one");
  record->add_option("FILE", output_, "File of the merged record, pcapng")->required();
  record->footer(
      "Exit codes: 0 the records of all runs are in it; 1 none is, or it was not written; 2 the rack is wrong; 3 a "
      "record is missing or damaged.");
  record_ = record;
}

std::optional<int> RackCommands::execute() const {
  if (check_ == nullptr) return std::nullopt;
  if (check_->parsed()) return rack_check(file_);
  if (status_->parsed())
    return options_.has_page() ? serve_rack(file_, options_.web) : show_rack_status(file_, options_.json);
  if (start_->parsed()) return rack_start(file_);
  if (stop_->parsed()) return rack_stop(file_);
  if (record_->parsed()) return rack_record(file_, output_);
  return std::nullopt;
}

}  // namespace imud
