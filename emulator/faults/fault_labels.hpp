// FaultLabels: what failed, and on which samples, for the log and for files by which a detector is scored.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "emulator/faults/fault_log.hpp"
#include "emulator/ground/drawn_terms.hpp"
#include "emulator/plan/config.hpp"
#include "emulator/plan/fault_config.hpp"

namespace imud {

// One occurrence of a fault on an imu, the occurrences there that are not in the log, or a fault that never began
// there.
struct FaultLabel {
  enum class State : std::uint8_t {
    acted,
    passed_over,  // the simulation's time leapt over the fault: `first` and `last` are of the sample after the leap
    never,        // the fault has never begun: `first` and `last` are of no sample
    // The log had no room: `first.occurrence` is how many occurrences acted, `last.occurrence` how many were passed
    // over.
    lost,
  };
  const FaultConfig* fault = nullptr;
  std::string imu;
  FaultEvent first;  // with its first sample
  FaultEvent last;   // with its last sample; equals `first` while it acts
  bool has_ended = false;
  State state = State::acted;
  SolutionErrors effect = {};  // of FaultEvent; negative where the unit has no solution of its own
};

// How often a fault of the configuration has acted, all imus together.
struct FaultOutcome {
  explicit FaultOutcome(const FaultConfig& fault, std::uint64_t occurred = 0)
      : name(fault.name), occurrences(occurred), may_fail_to_begin(fault.is_optional || fault.probability < 1) {}
  std::string name;
  std::uint64_t occurrences = 0;
  std::uint64_t lost = 0;          // of these, how many are not in the log
  bool is_passed_over = false;     // an occurrence, by a leap of the simulation's time
  bool may_fail_to_begin = false;  // optional, or each occurrence has a probability
  bool has_begun() const noexcept { return occurrences > 0; }
  // Describes the failure to begin of a fault that should have begun; empty for every other fault.
  std::string shortfall() const;
};

// Pairs begins and ends, in the order of the begins. Labels of lost occurrences follow. `imus`: their names, by
// number.
std::vector<FaultLabel> fault_labels(std::span<const FaultConfig> faults, std::span<const std::string> imus,
                                     const FaultLog& log);
// Adds a label for each of the faults, on each of its imus, that has none. The labels of faults of the same name,
// which control has begun, count as the fault's, also for fault_outcomes().
void add_never_begun(std::span<const FaultConfig> faults, std::vector<FaultLabel>& labels);
// Describes the occurrences that are not in the log; empty if there are none.
std::string lost_text(std::span<const FaultLabel> labels);
std::vector<FaultOutcome> fault_outcomes(std::span<const FaultConfig> faults, std::span<const FaultLabel> labels);
// Returns the numbers as drawn: "value=0.1 per_s=2".
std::string parameters_text(const FaultConfig& fault, const FaultEvent& event);
// Describes a begin or an end for the log.
std::string event_text(const FaultConfig& fault, const std::string& imu, const FaultEvent& event);

// Returns the name of the imu of this number, or the name of truth.
const std::string& imu_of(const FaultEvent& event, std::span<const std::string> imus);

// The constant errors that were drawn for an imu of the configuration.
struct DrawnLabel {
  std::string imu;
  DrawnTerms drawn;
};
std::vector<DrawnLabel> drawn_labels(std::span<const ImuConfig> imus, std::uint64_t seed);

// Returns a header row and a row for each label. emulator/faults/README.md has the columns. `seed` is the seed of the
// run, as another column before these, for the labels of many runs.
std::string labels_csv(std::span<const FaultLabel> labels, std::span<const DrawnLabel> drawn = {},
                       std::optional<std::uint64_t> seed = std::nullopt);
// Returns the labels as a JSON list of objects.
std::string labels_json(std::span<const FaultLabel> labels, std::span<const DrawnLabel> drawn = {},
                        std::optional<std::uint64_t> seed = std::nullopt);

}  // namespace imud
