// The pictures of a campaign.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "tools/campaign/case_statistics.hpp"

namespace imud {

struct CampaignPicture {
  std::string data;      // CSV, whose first line begins with campaign_data
  std::string commands;  // gnuplot's
};

// The name of the first column of the data, by which another file of the same name is told apart.
inline constexpr std::string_view campaign_data = "campaign_plot";

// Draws a figure: without an axis its histogram; over one axis the mean with a fan of percentiles, or the pass rate
// of an expectation with its interval; over two axes a heat map of the mean or the pass rate. The data are to stand
// at `data_path`. Throws std::runtime_error if there is nothing to draw, or an axis has too many values.
CampaignPicture draw_campaign(const CaseStatistics& statistics, std::size_t figure,
                              const std::vector<std::size_t>& axes, const std::string& data_path,
                              const std::string& picture);

// Draws the fan of percentiles of the figures "NAME@TIME" over the time; the rest is as above.
CampaignPicture draw_over_time(const CaseStatistics& statistics, const std::string& name,
                               const std::string& data_path, const std::string& picture);

}  // namespace imud
