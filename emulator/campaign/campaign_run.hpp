// campaign_run: runs the cases of a campaign on this machine, into a folder that is all of the campaign's state.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "emulator/campaign/campaign.hpp"
#include "emulator/campaign/shards/result_folder.hpp"

namespace imud {

struct CampaignRunOptions {
  std::optional<CaseRange> cases;  // whole shards; nullopt: all
  unsigned jobs = 0;               // processes; 0: one for each processor
  bool quiet = false;              // no progress
};

// Returns how many cases a shard has: Campaign::batch or, if that is 0, as many as make a hundred to a thousand
// shards of up to a million cases.
std::uint64_t batch_of(const Campaign& campaign) noexcept;

// Throws OpenError if the rows of so many cases do not fit on the disk of a folder. The folder need not exist yet.
void require_room(const std::string& folder, std::uint64_t cases, double row_bytes);
// Makes the folder of a campaign, or opens it if it has the same plan. Throws OpenError.
ResultFolder open_result_folder(const std::string& folder, const Campaign& campaign);
// Reads the plan of a folder: at its stored path or, if both were moved together, at the path relative to the folder.
// Throws ConfigError. Throws OpenError if the plan or imud is not the one that made the shards.
Campaign campaign_of(const ResultFolder& folder);
// Writes the folder's copy of the plan if it is missing. Throws OpenError.
void keep_plan_of(const ResultFolder& folder, const Campaign& campaign);

// Runs the cases that are missing in the folder, are in a shard that is not whole, or could not be run before. Each
// worker process runs many cases. In a run of the whole campaign, shards at which another process is at work come
// last. Two runs at the same time may still run some cases twice, with the same results. Without
// CampaignRunOptions::cases, temporary files that were left behind are removed first. Prints the result, and the
// progress on standard error. Returns the worst exit code of all cases, earlier runs included; 3 if a signal has
// ended the run. Throws ConfigError and PortError if the first of the cases cannot be run; OpenError if the folder
// has another campaign, cannot be written, or has no room for the results; std::runtime_error if a shard cannot be
// written.
int run_campaign(const std::string& plan, const std::string& folder, const CampaignRunOptions& options);
// Does the same with the plan of the folder.
int resume_campaign(const std::string& folder, const CampaignRunOptions& options);

}  // namespace imud
