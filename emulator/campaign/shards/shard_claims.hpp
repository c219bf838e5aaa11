// ShardClaims: marks in the folder the shards at which this run is at work, and finds the shards of other runs.
//
// A claim is the temporary file of the shard, whose name has the number of the run's process. Claims only save work;
// they are no locks: two runs that do the same shard write the same bytes.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>

#include "core/time.hpp"
#include "emulator/campaign/shards/result_folder.hpp"
#include "transports/host_clock.hpp"

namespace imud {

class ShardClaims {
 public:
  // All claims have the number of this process, also if its workers make them. `folder` must outlive this.
  explicit ShardClaims(const ResultFolder& folder) : folder_(folder), mine_("") {}

  // Claims a shard for this run, and returns true. If `yields`, and another process is at work on the shard, claims
  // nothing and returns false. To know this, claim() lists the folder, for at most a twentieth of a worker's time.
  bool claim(const CaseRange& shard, bool yields);
  // Removes the file of a claim, if there is one.
  void release(const CaseRange& shard) const noexcept;
  // Sets the time of each claim's file that is older than a minute to the present: other hosts remove a file that was
  // not written for a day. Looks at the files at most five times a second and, after a file was refreshed, each
  // minute.
  void refresh(const std::set<std::uint64_t>& first_cases);

 private:
  std::filesystem::path path_of(const CaseRange& shard) const;
  void look();
  bool is_look_due() const noexcept;

  const ResultFolder& folder_;
  TemporaryFile mine_;
  std::map<std::uint64_t, std::string> others_;  // the least file name among other processes' claims, by first case
  std::optional<HostTime> looked_, not_before_;  // not_before_: the next refresh()
  Nanoseconds look_took_{};
};

}  // namespace imud
