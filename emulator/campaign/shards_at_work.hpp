// ShardsAtWork: writes the shards of a run from rows that arrive in any order.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "emulator/campaign/missing_cases.hpp"
#include "emulator/campaign/shards/result_folder.hpp"
#include "emulator/campaign/shards/shard_arrays.hpp"
#include "emulator/campaign/shards/shard_claims.hpp"

namespace imud {

// Items are items of MissingCases. Functions throw std::runtime_error if a shard cannot be written.
class ShardsAtWork {
 public:
  // All arguments must outlive this.
  ShardsAtWork(const ResultFolder& folder, const MissingCases& cases, ShardClaims& claims, const ShardArrays& arrays)
      : folder_(folder), cases_(cases), claims_(claims), arrays_(arrays) {}
  // Removes the files of the shards that are not whole.
  ~ShardsAtWork();
  ShardsAtWork(const ShardsAtWork&) = delete;
  ShardsAtWork& operator=(const ShardsAtWork&) = delete;

  // `items`: at which workers are at work. Keeps the files of their shards young (ShardClaims::refresh()).
  void go_on(const std::vector<std::size_t>& items);
  // Takes the row of an item. Ignores a second row of the same item.
  void take(std::uint64_t item, std::string row);
  // Ends the shard of the item, because another process has written this shard.
  void leave(std::uint64_t item);
  // Puts the item off to the next pass, because another process is at work on the item's shard.
  void put_off(std::uint64_t item);
  // Returns the items that were put off, or whose shard was removed while it was written, and forgets them.
  std::vector<std::size_t> end_of_pass();

  // Returns whether the row of the item was taken, or the item's shard is done.
  bool has(std::uint64_t item) const;
  // Releases the claim that a worker may have made of the item's shard after the shard was done. Requires has(item).
  void drop(std::uint64_t item) const;
  std::uint64_t done() const noexcept { return done_; }        // items
  std::uint64_t stored() const noexcept { return stored_; }    // items in shards that are whole
  std::uint64_t written() const noexcept { return written_; }  // shards
  bool are_all_done() const noexcept { return ended_ == cases_.shards().size(); }
  // Counts the cases of the shards that have become whole during this run, whichever process has written them.
  const CaseTally& tally() const noexcept { return tally_; }

 private:
  struct AtWork {
    explicit AtWork(std::uint64_t first) : next(first) {}
    std::map<std::uint64_t, std::string> rows = {};  // taken and not written yet; by case
    std::uint64_t next;                              // the case of the next row to write
    std::uint64_t taken = 0;                         // items
    CaseTally tally = {};                            // of the items taken
    std::unique_ptr<ShardWriter> writer = {};
  };
  bool is_done(std::size_t number) const { return number < first_not_done_ || done_ahead_.contains(number); }
  std::map<std::uint64_t, std::string> rows_that_stay(const ShardToWrite& shard) const;
  bool is_there_as_good(const ShardToWrite& shard, std::uint64_t failed) const;
  bool commit(AtWork& at_work, const ShardToWrite& shard) const;
  void release(const CaseRange& shard) const noexcept;
  void end(std::size_t number);

  const ResultFolder& folder_;
  const MissingCases& cases_;
  ShardClaims& claims_;
  const ShardArrays& arrays_;
  std::map<std::size_t, AtWork> at_work_;  // by the number of the shard
  std::set<std::uint64_t> claimed_;        // the first cases of shards that may have a file
  std::set<std::uint64_t> put_off_;        // items
  std::size_t first_not_done_ = 0;
  std::set<std::size_t> done_ahead_;  // shards behind first_not_done_ that are done
  std::uint64_t done_ = 0, stored_ = 0, written_ = 0, ended_ = 0;
  CaseTally tally_;
};

}  // namespace imud
