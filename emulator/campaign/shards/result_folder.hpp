// ResultFolder: the folder with the results of a campaign, which is all of its state.
//
// `campaign.json` has the plan and the division into shards, `plan.toml` is a copy of the plan, and `shards` has the
// whole shards and the temporary files of shards at work.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "emulator/campaign/shards/shard.hpp"
#include "emulator/campaign/shards/shard_arrays.hpp"

namespace imud {

// The content of campaign.json.
struct CampaignDescription {
  std::string plan;         // absolute path
  std::string plan_sha256;  // of its text
  std::uint64_t cases = 0;
  std::uint64_t batch = 1;            // cases of a shard; the last shard may have fewer
  std::string version;                // of imud
  std::string build = {};             // of imud; empty in a folder of an imud that did not store it
  std::string plan_from_folder = {};  // the plan's path relative to the folder; empty if there is none
  std::string until = {};             // the text of a StopRule; empty: all cases are run
  ArrayShape arrays = {};

  // Returns the shard that has a case.
  CaseRange shard_of(std::uint64_t index) const noexcept;
  std::uint64_t shards() const noexcept { return (cases + batch - 1) / batch; }
  // Returns the cases of the shard of that number.
  CaseRange shard(std::uint64_t number) const noexcept { return shard_of(number * batch); }
  // Returns how the imud of the results differs from another imud: "imud is 0.1.0 there and 0.2.0 here", or the two
  // builds if the versions are equal. Returns an empty text if both are the same.
  std::string difference_of_imud(const std::string& other_version, const std::string& other_build) const;
  ShardHead head(const CaseRange& shard) const { return {plan_sha256, version, build, shard}; }
};

class ResultFolder {
 public:
  // Returns true if there is a folder with a campaign.
  static bool is_at(const std::filesystem::path& path);
  // Opens a folder that has a campaign. Throws OpenError.
  explicit ResultFolder(const std::filesystem::path& path);
  // Makes the folder of a campaign, or opens a folder that has the same campaign. Throws OpenError, with the
  // difference, if the folder has another campaign, and OpenError if the folder cannot be written.
  ResultFolder(const std::filesystem::path& path, const CampaignDescription& campaign, std::string_view plan_text);

  const std::filesystem::path& path() const noexcept { return path_; }
  // Return commands for a shell: to run the missing cases, and to run one case alone with a record.
  std::string resume_command() const;
  std::string repeat_command(std::uint64_t index) const;
  const CampaignDescription& campaign() const noexcept { return campaign_; }
  std::filesystem::path shards_path() const { return path_ / "shards"; }
  // Throws OpenError, with the difference, if the folder has another campaign.
  void require_same(const CampaignDescription& campaign, std::string_view plan_text) const;
  // Writes the copy of the plan if it is missing, because a process has ended too early. Throws OpenError.
  void keep_plan(std::string_view plan_text) const;
  // Throws OpenError if no file can be created in the folder of the shards.
  void check_writable() const;

  // The content of the folder `shards`.
  struct Listing {
    std::vector<CaseRange> shards;  // ascending; with the name of a whole shard, their content is not read
    std::vector<std::pair<TemporaryFile, CaseRange>>
        temporaries;                  // of shards at work: neither left behind nor older than their shard
    std::vector<std::string> others;  // names that belong to no campaign
  };
  // Throws OpenError if the folder of the shards cannot be read.
  Listing list() const;
  // Returns the shards at which other processes are at work, ascending and each once.
  std::vector<CaseRange> at_work() const;
  bool has(const CaseRange& shard) const;
  // Reads a shard of this campaign. Returns nullopt, with the reason in `fault`, if the shard is not whole, has a row
  // that is no result, is of another campaign, or has no file of arrays of the right size.
  std::optional<Shard> read(const CaseRange& shard, std::string& fault) const;
  // Reads the arrays of a shard. Returns how they differ from the digest in the shard's footer; empty if they do not
  // differ.
  std::string fault_of_arrays(const Shard& shard) const;
  // Removes the temporary files that processes of this host have left behind, and all that no process has written for
  // a day. Returns how many were removed.
  std::size_t remove_left_behind() const;

 private:
  void read_description();
  bool is_older_than_its_shard(const std::filesystem::path& file, const CaseRange& shard) const;

  std::filesystem::path path_;
  CampaignDescription campaign_;
};

}  // namespace imud
