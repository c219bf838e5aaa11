// MissingCases: the cases of a campaign that are still to be run, by their shards.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "emulator/campaign/shards/result_folder.hpp"

namespace imud {

struct Campaign;

// A shard that is written again.
struct ShardToWrite {
  CaseRange cases;
  std::uint64_t before = 0;                // items of earlier shards
  bool replaces = false;                   // a shard that is damaged, or has cases that could not be run
  std::vector<std::uint64_t> to_run = {};  // ascending; empty: all. The rows of the other cases stay

  std::uint64_t items() const noexcept { return to_run.empty() ? cases.size() : to_run.size(); }
  std::uint64_t kept() const noexcept { return cases.size() - items(); }
  std::uint64_t case_of_item(std::uint64_t item) const noexcept {
    return to_run.empty() ? cases.first + item : to_run[item];
  }
};

// The cases as items of work, numbered from 0.
class MissingCases {
 public:
  // Looks at all shards with cases of `range`, which begins and ends with a shard. Logs what is damaged. Throws
  // OpenError if a shard has rows of another configuration than the plan has now: of the cases that differ in the
  // seed alone, the first kept one of a shard is compared. If the range is the whole campaign, shards at which
  // another process is at work are the last.
  MissingCases(const ResultFolder& folder, const CaseRange& range, const Campaign& campaign);

  std::uint64_t items() const noexcept { return items_; }
  std::uint64_t case_of(std::uint64_t item) const noexcept;
  // Returns the number of the shard of an item in shards().
  std::size_t shard_of(std::uint64_t item) const noexcept;
  const std::vector<ShardToWrite>& shards() const noexcept { return shards_; }

  // The rows that stay.
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
