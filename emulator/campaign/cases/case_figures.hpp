// The figures of a case: the numbers of its summary that depend on the case alone, and, in `realtime`, its lateness.
#pragma once

#include <nlohmann/json.hpp>

#include "emulator/report/summary.hpp"

namespace imud {

// Returns the counts by the names that `--require` has, "imu1.samples" and "truth.received"; `simulated_s`; and what
// was drawn for each imu, "imu1.gyro.unit.bias_x", SI. A count of 0 is left out, unless every summary has it. Without
// durations and anything else of the host; but samples by the host's clock have "imu1.lateness_us.p99" and ".max".
nlohmann::ordered_json case_figures(const Summary& summary);

}  // namespace imud
