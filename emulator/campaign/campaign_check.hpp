// campaign_check: finds the cases of a plan that cannot be run, and prints the time and the disk space of the others.
#pragma once

#include <cstdint>
#include <string>

#include "emulator/campaign/campaign.hpp"

namespace imud {

// How many configurations try_cases() has loaded.
struct TriedCases {
  std::uint64_t values = 0;        // of axes, each beside the first values of the other axes
  std::uint64_t all_values = 0;    // all values that the axes have
  std::uint64_t draws = 0;         // the least and the greatest of each key, and others at equal distances
  std::uint64_t combinations = 0;  // cases at equal distances, the last one among them
};

// Loads the configurations of cases, and makes their parts on ports that are not opened: each value of each axis, or
// a thousand at equal distances if an axis has more; the draws with the least and the greatest value of each key, and
// up to 32 others; up to 32 combinations. Throws ConfigError that names each value which cannot be used, and the
// number of the first case that has it.
TriedCases try_cases(const Campaign& campaign);

// Reads the plan, calls try_cases(), and runs a few cases. Prints the axes, the number of cases, their expected time
// on this machine, and the bytes of the results. Returns the exit code. Throws ConfigError.
int campaign_check(const std::string& plan);

}  // namespace imud
