// CampaignCommands: the commands `imud campaign ...`.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "emulator/campaign/campaign_bisect.hpp"
#include "emulator/campaign/campaign_run.hpp"
#include "emulator/campaign/slurm_run.hpp"
#include "emulator/web/status_page_options.hpp"

namespace imud {

class CampaignCommands {
 public:
  // Adds the command to the command line, which outlives this, and if it is given, the commands below it: making
  // their options would take a tenth of the time in which imud starts.
  CampaignCommands(CLI::App& app, bool is_given);
  // Executes the command that was given, and returns its exit code; nullopt: another one was given. Throws
  // ConfigError if the plan is wrong. Does not return from `collect` and `report`, which become another program.
  std::optional<int> execute() const;

 private:
  void add_run(CLI::App& campaign);
  // Returns true if the cases run on Slurm. Throws OpenError if options do not suit the engine.
  bool is_for_slurm() const;
  void add_bisect(CLI::App& campaign);
  void add_tools(CLI::App& campaign);

  std::string plan_, folder_, record_;
  std::string engine_;  // "local" or "slurm"; empty: by the folder
  std::uint64_t case_ = 0;
  StatusPageOptions status_options_;  // of `status`
  std::vector<std::string> values_;   // of `repeat`
  CampaignBisectOptions bisect_options_;
  CampaignRunOptions run_options_;
  SlurmRunOptions slurm_options_;
  const CLI::App *check_ = nullptr, *run_ = nullptr, *resume_ = nullptr, *status_ = nullptr, *repeat_ = nullptr,
                 *bisect_ = nullptr;
  std::vector<const CLI::App*> tools_;
};

}  // namespace imud
