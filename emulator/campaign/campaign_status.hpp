// campaign_status: how far a campaign has come, by its folder alone.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "emulator/campaign/shards/result_folder.hpp"

namespace imud {

struct CampaignStatus {
  std::uint64_t shards = 0, shards_whole = 0;
  std::uint64_t cases_done = 0;
  std::uint64_t failed = 0;               // cases that could not be run
  std::uint64_t expectations_failed = 0;  // cases with an expectation that does not hold
  std::uint64_t incomplete = 0;           // other cases whose exit code is not 0
  std::vector<std::string> damaged;       // shards that are not whole, each with the reason
  std::vector<TemporaryFile> running;     // files of processes that run, or of other hosts
  std::optional<double> left_s;           // by the shards' times, if a process runs
};

// Reads all shards.
CampaignStatus status_of(const ResultFolder& folder);

// Prints the status. Returns 0 if all cases are done, none is incomplete and all expectations hold, otherwise 3.
// Throws OpenError if there is no campaign.
int campaign_status(const std::string& folder, bool as_json);

}  // namespace imud
