// SequentialStop: the number of cases after which a campaign with the key `until` has ended.
//
// The pass rate of the cases 0 to N - 1 is looked at for each N that is the end of a shard, in the order of the
// cases: the first one at which StopRule::is_met() is the end. So it depends on the rows alone, not on who has made
// them, nor on their order in time. A case that could not be run defers the end until it was run again.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "emulator/campaign/shards/result_folder.hpp"
#include "emulator/campaign/shards/stop_rule.hpp"

namespace imud {

class SequentialStop {
 public:
  // Reads no shard yet. `folder` must outlive this, at its place.
  explicit SequentialStop(const ResultFolder& folder)
      : folder_(folder), rule_(StopRule::parse(folder.campaign().until)) {}

  SequentialStop(const SequentialStop&) = delete;
  SequentialStop& operator=(const SequentialStop&) = delete;

  // Reads the shards that continue the ones that were read, up to the end. Returns true if the campaign has ended.
  bool look();
  bool has_ended() const noexcept { return has_ended_; }
  // Returns how many cases the campaign needs: from case 0 to its end or, as long as that is not known, all.
  std::uint64_t cases() const noexcept { return has_ended_ ? next_ : folder_.campaign().cases; }
  // Returns the cases of `range` that the campaign needs; nullopt if there are none.
  std::optional<CaseRange> needed(const CaseRange& range) const noexcept;
  // Returns the rule with the interval so far, for people; empty if the plan has none.
  std::string text() const;

 private:
  // Counts a row. Returns false if the case could not be run.
  bool count(const std::string& row);

  const ResultFolder& folder_;
  const std::optional<StopRule> rule_;
  std::uint64_t next_ = 0;               // the first case that was not looked at
  std::uint64_t runs_ = 0, passes_ = 0;  // of the cases before it
  bool has_ended_ = false;
};

}  // namespace imud
