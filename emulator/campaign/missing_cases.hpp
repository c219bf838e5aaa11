// MissingCases: the cases of a campaign that are still to be run, by their shards.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "emulator/campaign/shards/result_folder.hpp"

namespace imud {

class CaseRunner;
struct Campaign;

// A shard that is written again.
struct ShardToWrite {
  CaseRange cases;
  std::uint64_t before = 0;                        // items of earlier shards
  bool replaces = false;                           // a shard that is damaged, or has cases that could not be run
  std::vector<std::uint64_t> to_run = {};          // ascending; empty: all
  std::map<std::uint64_t, std::string> kept = {};  // the rows of the other cases

  std::uint64_t items() const noexcept { return to_run.empty() ? cases.size() : to_run.size(); }
  std::uint64_t case_of_item(std::uint64_t item) const noexcept {
    return to_run.empty() ? cases.first + item : to_run[item];
  }
};

// The cases as items of work, numbered from 0.
class MissingCases {
 public:
  // Looks at all shards with cases of `range`, which begins and ends with a shard. Logs what is damaged. Throws
  // OpenError if a shard has rows of another configuration than the plan has now.
  MissingCases(const ResultFolder& folder, const CaseRange& range, const Campaign& campaign, CaseRunner& runner);

  std::uint64_t items() const noexcept { return items_; }
  std::uint64_t case_of(std::uint64_t item) const noexcept;
  // Returns the number of the shard of an item in shards().
  std::size_t shard_of(std::uint64_t item) const noexcept;
  const std::vector<ShardToWrite>& shards() const noexcept { return shards_; }

 private:
  void add(ShardToWrite shard);

  std::vector<ShardToWrite> shards_;
  std::uint64_t items_ = 0;
};

}  // namespace imud
