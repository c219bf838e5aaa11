// campaign_repeat: runs one case of a campaign alone, and compares it with its stored row.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace imud {

// Runs case `index` of a plan, or of the campaign in a folder, and prints its row. `record`: a file for the record of
// the run; empty: none. `values`: texts "AXIS=VALUE", which replace values of the case; then no row is compared,
// because the folder has no row of such a case. Returns the exit code of the case, or 1 if the new row differs from
// the row in the folder; then standard error gets the differences. A case by the clock `realtime` is not compared.
// Throws ConfigError, and OpenError if there is no such plan, folder or case.
int repeat_case(const std::string& plan_or_folder, std::uint64_t index, const std::string& record,
                const std::vector<std::string>& values);

}  // namespace imud
