// SequentialStop: the number of cases after which a campaign with the key `until` has ended.
//
// The rule is applied to the pass rate of the cases 0 to N - 1, for each N at which a shard ends, in ascending order.
// The campaign ends at the first N for which StopRule::is_met(). This N depends on the rows alone: neither on the
// process that has made a row, nor on the time. A case that could not be run defers the end until it is run again.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "emulator/campaign/shards/result_folder.hpp"
#include "emulator/campaign/shards/stop_rule.hpp"

namespace imud {

class SequentialStop {
 public:
  // Reads no shard yet. `folder` must outlive this, and must not be moved.
  explicit SequentialStop(const ResultFolder& folder)
      : folder_(folder), rule_(StopRule::parse(folder.campaign().until)) {}

  SequentialStop(const SequentialStop&) = delete;
  SequentialStop& operator=(const SequentialStop&) = delete;

  // Reads the shards that follow the last one read, without a gap, until the campaign has ended. Returns true if the
  // campaign has ended.
  bool look();
  bool has_ended() const noexcept { return has_ended_; }
  // Returns how many cases the campaign needs, from case 0 on: up to the end or, until the end is known, all.
  std::uint64_t cases() const noexcept { return has_ended_ ? next_ : folder_.campaign().cases; }
  // Returns the cases of `range` that the campaign needs; nullopt if there are none.
  std::optional<CaseRange> needed(const CaseRange& range) const noexcept;
  // Returns a line for people, with the rule and the present interval; empty if the plan has no rule.
  std::string text() const;

 private:
  // Counts a row. Returns false if the case could not be run.
  bool count(const std::string& row);

  const ResultFolder& folder_;
  const std::optional<StopRule> rule_;
  std::uint64_t next_ = 0;               // the first case that is not counted
  std::uint64_t runs_ = 0, passes_ = 0;  // of the cases before next_
  bool has_ended_ = false;
};

}  // namespace imud
