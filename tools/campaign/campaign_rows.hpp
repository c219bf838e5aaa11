// CampaignRows: the rows of a campaign's shards, in the order of the cases.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "emulator/campaign/shards/result_folder.hpp"
#include "emulator/campaign/shards/sequential_stop.hpp"

namespace imud {

class CampaignRows {
 public:
  // Throws OpenError if the folder has no campaign.
  explicit CampaignRows(const std::string& path) : folder_(path) { stop_.look(); }

  const CampaignDescription& campaign() const noexcept { return folder_.campaign(); }

  // Returns how many cases the campaign needs, and how its key `until` has ended it; "" if the plan has none.
  std::uint64_t cases() const noexcept { return stop_.cases(); }
  std::string until() const { return stop_.text(); }

  // Calls `take` with each row of the whole shards that the campaign needs, in the order of the cases. The next shard
  // is read meanwhile, by another thread. `progress` receives the share that is done, from 0 to 1.
  using Take = std::function<void(std::string_view row, std::uint64_t index)>;
  void read(const Take& take, const std::function<void(double)>& progress);

  // Return what the last read() has found: a line for each shard that is not whole and for each range of cases
  // without a shard, and the number of cases that are there.
  const std::vector<std::string>& faults() const noexcept { return faults_; }
  std::uint64_t found() const noexcept { return found_; }

  // Return the commands that run what is missing, and one case alone, for a shell.
  std::string resume_command() const { return folder_.resume_command(); }
  std::string repeat_command(std::uint64_t index) const { return folder_.repeat_command(index); }

 private:
  void note_missing(std::uint64_t first, std::uint64_t end);

  ResultFolder folder_;
  SequentialStop stop_{folder_};
  std::uint64_t found_ = 0;
  std::vector<std::string> faults_;
};

}  // namespace imud
