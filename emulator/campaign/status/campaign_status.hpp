// CampaignStatus: the progress of a campaign, read from its folder alone.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "emulator/campaign/shards/result_folder.hpp"
#include "emulator/campaign/shards/sequential_stop.hpp"
#include "emulator/campaign/status/case_counts.hpp"

namespace imud {

class CampaignStatus {
 public:
  // Throws OpenError if there is no campaign.
  explicit CampaignStatus(const std::string& folder) : folder_(folder) {}

  // Reads the shards that are new or changed since the last call: at least one, and no further one after `limit_s`
  // seconds. Returns false if such shards are left.
  bool update(double limit_s = std::numeric_limits<double>::infinity());

  // Returns true if all cases are done, none is incomplete, and all expectations hold.
  bool is_good() const noexcept;
  nlohmann::ordered_json json() const;
  std::string text() const;

 private:
  struct SeenShard {
    std::filesystem::file_time_type time;
    std::uint64_t cases = 0;
    std::string fault;                 // the reason why the shard is not whole
    std::optional<CaseCounts> counts;  // of a shard with a case that could not be run, which `resume` replaces
  };
  std::optional<double> cases_per_s() const;
  std::optional<double> left_s() const;
  std::vector<std::string> damaged() const;
  std::uint64_t whole() const noexcept;
  // Returns how many shards the campaign needs.
  std::uint64_t shards() const noexcept {
    const std::uint64_t batch = folder_.campaign().batch;
    return (stop_.cases() + batch - 1) / batch;
  }

  const ResultFolder folder_;
  SequentialStop stop_{folder_};
  CaseCounts lasting_;                       // of the shards that `resume` does not replace
  CaseCounts counts_;                        // of all shards
  std::map<std::uint64_t, SeenShard> seen_;  // by the first case
  std::size_t present_ = 0;                  // shards in the folder
  std::vector<TemporaryFile> running_;       // files of processes that run, or of other hosts
};

// Prints the status. Returns 0 if it is good, otherwise 3. Throws OpenError if there is no campaign.
int campaign_status(const std::string& folder, bool as_json);

}  // namespace imud
