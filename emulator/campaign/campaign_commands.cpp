#include "emulator/campaign/campaign_commands.hpp"

#include <CLI/CLI.hpp>

#include "emulator/campaign/campaign_check.hpp"

namespace imud {

CampaignCommands::CampaignCommands(CLI::App& app) {
  CLI::App* campaign = app.add_subcommand("campaign",
                                          "Replay the many cases of a plan: values of keys, captures, "
                                          "scenarios, random draws and seeds");
  campaign->require_subcommand(1);
  CLI::App* check = campaign->add_subcommand(
      "check", "List every fault of a plan, or show how many cases it has, how long they take and what they write");
  check->add_option("PLAN", plan_, "Plan of the campaign, TOML")->required();
  check_ = check;
}

std::optional<int> CampaignCommands::execute() const {
  if (check_->parsed()) return campaign_check(plan_);
  return std::nullopt;
}

}  // namespace imud
