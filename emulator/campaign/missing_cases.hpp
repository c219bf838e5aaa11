// MissingCases: the cases of a campaign that are still to be run, by their shards.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "emulator/campaign/shards/result_folder.hpp"

namespace imud {

struct Campaign;

// A shard that is to be written.
struct ShardToWrite {
  CaseRange cases;
  std::uint64_t before = 0;                // items of earlier shards
  bool replaces = false;                   // the folder has this shard, damaged or with cases that could not be run
  std::vector<std::uint64_t> to_run = {};  // cases, ascending; empty: all. The rows of the other cases are kept

  std::uint64_t items() const noexcept { return to_run.empty() ? cases.size() : to_run.size(); }
  std::uint64_t kept() const noexcept { return cases.size() - items(); }
  std::uint64_t case_of_item(std::uint64_t item) const noexcept {
    return to_run.empty() ? cases.first + item : to_run[item];
  }
};

// The cases as items of work, numbered from 0.
class MissingCases {
 public:
  // Reads all shards of `range`, which must begin and end at limits of shards. Logs damaged shards. Throws OpenError
  // if the configuration of a kept row differs from the plan's present one. Among cases that differ in the seed
  // alone, only the first kept row of a shard is compared. If the range is the whole campaign, shards at which
  // another process is at work come last.
  MissingCases(const ResultFolder& folder, const CaseRange& range, const Campaign& campaign);

  std::uint64_t items() const noexcept { return items_; }
  std::uint64_t case_of(std::uint64_t item) const noexcept;
  // Returns the number of the shard of an item in shards().
  std::size_t shard_of(std::uint64_t item) const noexcept;
  const std::vector<ShardToWrite>& shards() const noexcept { return shards_; }

  // The rows of the folder that are kept.
  struct Kept {
    std::uint64_t rows = 0, bytes = 0;
    CaseTally tally = {};
  };
  const Kept& kept() const noexcept { return kept_; }

 private:
  std::vector<ShardToWrite> shards_;
  std::uint64_t items_ = 0;
  Kept kept_;
};

}  // namespace imud
