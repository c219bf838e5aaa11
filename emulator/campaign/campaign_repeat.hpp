// campaign_repeat: runs one case of a campaign alone, and compares it with its stored row.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace imud {

// Runs case `index` of a plan, or of the campaign in a folder, and prints its row. `record`: a file for the record of
// the run, empty: none. `values`: "AXIS=VALUE", in place of the value that the case has; then it is another case,
// which no row in the folder belongs to. Returns the exit code of the case; 1 if it differs from the row in the
// folder, with what differs on standard error; a case by the clock `realtime` is not compared. Throws ConfigError,
// and OpenError if there is no such plan, folder or case.
int repeat_case(const std::string& plan_or_folder, std::uint64_t index, const std::string& record,
                const std::vector<std::string>& values);

}  // namespace imud
