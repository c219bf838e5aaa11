// CampaignCommands: the commands `imud campaign ...`.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "emulator/campaign/campaign_run.hpp"

namespace CLI {
class App;
}

namespace imud {

class CampaignCommands {
 public:
  // Adds the commands to the command line, which outlives this.
  explicit CampaignCommands(CLI::App& app);
  // Executes the command that was given, and returns its exit code; nullopt: another one was given. Throws
  // ConfigError if the plan is wrong.
  std::optional<int> execute() const;

 private:
  void add_run(CLI::App& campaign);

  std::string plan_, folder_, record_;
  std::uint64_t case_ = 0;
  bool json_ = false;
  CampaignRunOptions run_options_;
  const CLI::App *check_ = nullptr, *run_ = nullptr, *resume_ = nullptr, *status_ = nullptr, *repeat_ = nullptr;
};

}  // namespace imud
