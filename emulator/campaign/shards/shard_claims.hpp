// ShardClaims: says in the folder which shards this run is at work on, and knows which ones other runs are.
//
// A claim is the temporary file of the shard, in the name of the run's process. It is a courtesy, not a lock: two
// runs that do the same shard write the same bytes.
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
  // The claims are in the name of this process, also if workers make them. `folder` must outlive this.
  explicit ShardClaims(const ResultFolder& folder) : folder_(folder), mine_("") {}

  // Claims a shard, unless this run has it already. With `yields` it returns false, and claims nothing, if another
  // process is at work on the shard. For that it lists the folder, which takes a twentieth of a worker's time at
  // most.
  bool claim(const CaseRange& shard, bool yields);
  // Removes the file of a claim, if there is one.
  void release(const CaseRange& shard) const noexcept;
  // Makes the files of claims young again that are older than a minute, because other hosts remove a file that nobody
  // has written for a day. Looks at most five times a second and, once it has found one, each minute.
  void refresh(const std::set<std::uint64_t>& first_cases);

 private:
  std::filesystem::path path_of(const CaseRange& shard) const;
  void look();
  bool is_look_due() const noexcept;

  const ResultFolder& folder_;
  TemporaryFile mine_;
  std::map<std::uint64_t, std::string> others_;  // the least name of a file of others, by the first case
  std::optional<HostTime> looked_, not_before_;  // not_before_: the next refresh()
  Nanoseconds look_took_{};
};

}  // namespace imud
