// The statistics of a campaign as text for people and as JSON.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "tools/campaign/campaign_rows.hpp"
#include "tools/campaign/case_statistics.hpp"

namespace imud {

// Returns the figures to show: if the user has named some, all of these; otherwise the metrics of the test, or, if
// there are none, the figures that are not the same in all cases; in either case without "NAME@TIME".
std::vector<std::size_t> figures_to_show(const CaseStatistics& statistics, bool is_asked);

// Returns the order in which to show an axis: by number if all its values are numbers, otherwise as they came.
std::vector<std::size_t> order_of(const CaseStatistics::Axis& axis);

struct ReportChoice {
  std::vector<std::size_t> figures;  // beside the expectations
  std::vector<std::size_t> axes;     // by whose values to divide
};

// Returns tables: how the cases ended, pass rates with their intervals, figures with mean, standard deviation and
// percentiles, all of these by the values of each axis, and the worst and the failed cases with the commands that
// repeat them.
std::string campaign_text(const CaseStatistics& statistics, const CampaignRows& rows, const ReportChoice& choice);
// Returns the same as a JSON object.
std::string campaign_json(const CaseStatistics& statistics, const CampaignRows& rows, const ReportChoice& choice);

}  // namespace imud
