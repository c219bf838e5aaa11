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

// Throws OpenError if so many cases would not fit the disk of a folder, which need not exist yet.
void require_room(const std::string& folder, std::uint64_t cases, double row_bytes);
// Makes the folder of a campaign, or opens it if it has the same plan. Throws OpenError.
ResultFolder open_result_folder(const std::string& folder, const Campaign& campaign);
// Reads the plan of a folder: at its path, or where it lies now if it was moved together with the folder. Throws
// ConfigError, and OpenError if it, or imud, is not the one of the folder's shards.
Campaign campaign_of(const ResultFolder& folder);
// Writes the folder's copy of the plan if it is missing. Throws OpenError.
void keep_plan_of(const ResultFolder& folder, const Campaign& campaign);

// Runs the cases that are missing in the folder, are in a shard that is not whole, or could not be run before; in
// processes, each of which runs many. A shard at which another process is at work comes last in a run of the whole
// campaign. Two calls at the same time can still do some cases twice, with the same results. Without
// CampaignRunOptions::cases left-behind temporary files are removed first. Prints what was done, and the progress on
// standard error. Returns the worst exit code of a case, whether it was run now or before; 3 if a signal has ended
// it. Throws ConfigError and PortError if the first of the cases cannot be run, OpenError if the folder has another
// campaign, cannot be written, or has no room for the results; std::runtime_error if a shard cannot be written.
int run_campaign(const std::string& plan, const std::string& folder, const CampaignRunOptions& options);
// The same with the plan of the folder.
int resume_campaign(const std::string& folder, const CampaignRunOptions& options);

}  // namespace imud
