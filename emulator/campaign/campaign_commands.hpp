// CampaignCommands: the commands `imud campaign ...`.
#pragma once

#include <optional>
#include <string>

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
  std::string plan_;
  const CLI::App* check_;
};

}  // namespace imud
