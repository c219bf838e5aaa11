// CampaignCost: how long a case takes on this machine, and how many bytes its row has, measured on a few cases.
#pragma once

#include <cstdint>
#include <vector>

#include "emulator/campaign/campaign.hpp"

namespace imud {

struct CampaignCost {
  std::vector<std::uint64_t> cases;  // the cases that were run: the first, the middle and the last
  double case_s = 0;                 // mean host time of a case: its configuration, its identity and its run
  bool is_cut = false;               // a case was not followed to its end: the time is a lower bound
  double row_bytes = 0;              // mean, of a row of the results; an estimate
  unsigned processors = 1;           // of this machine
};

// Runs a few cases one after the other in this process, on ports that accept every frame, and stops each case after
// 20 s. Cases by the clock `realtime` are not run: their time is settle_s and the time of their captures. Throws
// ConfigError, and PortError if a capture cannot be read.
CampaignCost measure_cases(const Campaign& campaign);

}  // namespace imud
