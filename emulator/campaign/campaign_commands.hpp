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
  // Adds the command `campaign` to `app`, which must outlive this. `is_given`: the command line has this command;
  // only then its subcommands are added, because their options would take a tenth of the time in which imud starts.
  CampaignCommands(CLI::App& app, bool is_given);
  // Executes the subcommand of the command line. Returns its exit code; nullopt if the command line has another
  // command. Throws ConfigError if the plan is wrong. Does not return from `collect` and `report`: another program
  // takes the place of this one.
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
