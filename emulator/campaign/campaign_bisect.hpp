// campaign_bisect: finds where on an axis of a campaign a case begins to fail.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

namespace imud {

struct CampaignBisectOptions {
  std::string axis;                    // of numbers
  std::optional<std::uint64_t> index;  // a case whose other values are held; nullopt: each combination of them
  double tolerance = 0;                // in the unit of the axis; 0: a thousandth of the distance of its values
  unsigned jobs = 0;                   // processes; 0: one for each processor
};

// Runs the values of the axis in ascending order, beside the values that the other axes, the draw and the seed of a
// case have; then halves the interval between the first two neighbours of which one passes and one fails. Prints, for
// each combination, between which values that is, whether other neighbours differ, too, and the command that repeats
// the nearest failing case alone. A case fails if its exit code is not 0. The folder of a campaign stands for its
// plan; nothing is written into it. Returns 0; 3 if a signal has ended it. Throws ConfigError, OpenError if there is
// no such axis or case, and std::runtime_error if a case cannot be run.
int bisect_campaign(const std::string& plan_or_folder, const CampaignBisectOptions& options);

}  // namespace imud
