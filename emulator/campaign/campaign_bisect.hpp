// campaign_bisect: finds where on an axis of a campaign a case begins to fail.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

namespace imud {

struct CampaignBisectOptions {
  std::string axis;                    // name of an axis of numbers
  std::optional<std::uint64_t> index;  // a case whose other values are held; nullopt: each combination of them
  double tolerance = 0;                // in the unit of the axis; 0: a thousandth of the distance of its values
  unsigned jobs = 0;                   // processes; 0: one for each processor
};

// Runs the values of the axis in ascending order; the other axes, the draw and the seed keep the values of a case.
// Afterwards halves the interval between the first two neighbours of which one passes and one fails. A case fails if
// its exit code is not 0. Prints for each combination the two values between which the result changes, whether other
// neighbours differ as well, and the command that repeats the nearest failing case alone. The folder of a campaign
// stands for its plan; nothing is written into the folder. Returns 0, or 3 if a signal has ended the search. Throws
// ConfigError, OpenError if there is no such axis or case, and std::runtime_error if a case cannot be run.
int bisect_campaign(const std::string& plan_or_folder, const CampaignBisectOptions& options);

}  // namespace imud
