// CampaignArrays: the measurements of all cases of a campaign as one HDF5 file.
#pragma once

#include <string>

#include "tools/campaign/campaign_rows.hpp"

namespace imud {

// Writes a file with a virtual data set for each imu, arrays/NAME: a dimension for each axis, for the draws if there
// are any, for the seeds, and for the rows of a case. It has no measurements: they stay in the files beside the
// shards, which it names by their absolute paths. Cases of shards that the last CampaignRows::read() has not found
// whole have no value. The file takes its place when it is whole. Throws std::runtime_error, which names the file, if
// it cannot be written.
void write_campaign_arrays(const CampaignRows& rows, const std::string& path);
// Throws std::invalid_argument if the campaign has no arrays, or too many axes for HDF5, or `path` is a stream.
void check_campaign_arrays(const CampaignDescription& campaign, const std::string& path);

}  // namespace imud
