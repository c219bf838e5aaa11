// CampaignRows: the rows of a campaign's shards, in the order of the cases.
#pragma once

#include <cstdint>
#include <filesystem>
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

  // Returns the number of cases that the campaign needs, and how the key `until` has ended the campaign; "" if the
  // plan has no such key.
  std::uint64_t cases() const noexcept { return stop_.cases(); }
  std::string until() const { return stop_.text(); }

  // Calls `take` with each row of the whole shards that the campaign needs, in the order of the cases. Another
  // thread reads the next shard meanwhile. `progress` receives the finished share, from 0 to 1.
  using Take = std::function<void(std::string_view row, std::uint64_t index)>;
  void read(const Take& take, const std::function<void(double)>& progress);

  // Return the findings of the last read(): a line for each incomplete shard and for each range of cases without a
  // shard, and the number of cases that were read.
  const std::vector<std::string>& faults() const noexcept { return faults_; }
  std::uint64_t found() const noexcept { return found_; }
  // Returns the shards that it has found whole, ascending.
  const std::vector<CaseRange>& whole() const noexcept { return whole_; }

  // From now on a shard whose arrays differ from its footer is not whole, either.
  void check_arrays() noexcept { checks_arrays_ = true; }
  std::filesystem::path shards_path() const { return folder_.shards_path(); }

  // Return shell commands: to run the missing cases, and to run one case alone.
  std::string resume_command() const { return folder_.resume_command(); }
  std::string repeat_command(std::uint64_t index) const { return folder_.repeat_command(index); }

 private:
  void note_missing(std::uint64_t first, std::uint64_t end);

  ResultFolder folder_;
  SequentialStop stop_{folder_};
  std::uint64_t found_ = 0;
  std::vector<CaseRange> whole_;
  bool checks_arrays_ = false;
  std::vector<std::string> faults_;
};

}  // namespace imud
