// The truth at the measurements of a run: from imus without errors, which run beside the imus.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "emulator/imu/ports.hpp"
#include "emulator/plan/config.hpp"
#include "emulator/record/measurement_rows.hpp"
#include "emulator/record/row_truths.hpp"

namespace imud {

// Runs a configuration with these ports. The last parameter, which may be nullptr, is
// RecordedRun::Options::awaits_truth. Returns why there may be no measurement.
using TwinRun = std::function<std::string(const Config& config, const Ports& ports,
                                          const std::function<void(std::size_t imu)>& awaits_truth)>;

// The truth of a run: the motion without any fault.
struct RunTruth {
  struct OfImu {
    std::vector<TrueRow> rows;     // at each measurement
    std::vector<TrueRow> samples;  // at each sample, with the increments since the sample before; empty unless kept
  };
  std::vector<OfImu> imus;
  std::string cause;  // why there may be no measurement
};
// Runs the imus and imus without errors, both without faults. Where a run has extrapolated or held motion, its truth
// is the later truth for the same instant; NaN if none came. True increments are sums as in
// TrueRow, and NaN in the first one if samples that are not sent precede it.
RunTruth truth_of_run(const Config& config, const TwinRun& run,
                      const std::function<bool(std::size_t imu)>& keeps_samples);

// Returns the number of measurements of each imu, with the faults of `config`.
std::vector<std::uint64_t> count_measurements(const Config& config, const TwinRun& run);

// Takes the measurements of the imus before the faults of messages and wires, by the imus' order.
std::vector<std::vector<MadeRow>> made_rows(const Config& config, const TwinRun& run);

// Returns true if the fault can change which measurements of an imu arrive, or when. Faults of sensors cannot.
bool changes_rows(const FaultConfig& fault);

}  // namespace imud
