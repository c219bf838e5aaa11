// The figures of a case: the numbers of its summary that depend on the case alone, and, in `realtime`, its lateness.
#pragma once

#include <nlohmann/json.hpp>

#include "emulator/report/summary.hpp"

namespace imud {

// Returns an object of numbers: the counts, named as for `--require` ("imu1.samples", "truth.received");
// `simulated_s`; and the errors that were drawn for each imu, SI ("imu1.gyro.unit.bias_x"). Counts of 0 are left out,
// except the counts that every summary has. There are no durations and nothing else of the host, except
// "imu1.lateness_us.p99" and ".max" if samples are paced by the host's clock.
nlohmann::ordered_json case_figures(const Summary& summary);

}  // namespace imud
