// Outcome: how a run ended, whether it is complete, and whether it kept the limits that were required of it.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/requirement.hpp"
#include "emulator/faults/expectations.hpp"
#include "emulator/faults/fault_labels.hpp"
#include "emulator/plan/config.hpp"

namespace imud {

struct Summary;

enum class EndedBy : std::uint8_t { end_of_capture, duration, signal, control, failure };
// Returns the word of the JSON: "end_of_capture", "for", "signal", "control", "failure".
std::string_view word(EndedBy ended_by) noexcept;

struct Outcome {
  EndedBy ended_by = EndedBy::signal;
  // A phrase for each thing that is missing: "99 truths refused (99 crc)". Empty: the run is complete.
  std::vector<std::string> shortfalls;
  // A limit that was required, and the figure that it is about.
  struct Required {
    Requirement requirement;
    std::optional<std::uint64_t> seen;  // nullopt: the figure is not known, and the limit does not hold
    bool holds = false;
    // Returns "301", or "not known".
    std::string seen_text() const;
  };
  std::vector<Required> required;
  std::vector<Expected> expected;    // of the hosts
  std::vector<FaultOutcome> faults;  // of the configuration

  bool is_complete() const noexcept { return shortfalls.empty(); }
  // Returns 0 if the run is complete and every limit and expectation holds, 1 after a failure, otherwise 3.
  int exit_code() const noexcept;
  // Sets `faults`. A fault that has never begun is a shortfall, unless it need not begin, a signal or a command has
  // ended the run early, or `is_repeated`.
  void judge_faults(std::vector<FaultOutcome> all, bool is_repeated = false);
};

// Throws RequirementError if a requirement is about a figure that a run of `config` does not have.
void check_figures(std::span<const Requirement> requirements, const Config& config);

// Judges a run of `config`. With a capture as truth nothing may be missing: the capture was read to its end, every
// truth in it was accepted, no sample was skipped, and every frame was written; at the recorded pace, frames that
// nobody read from a pty are not missing. Without a requirement about truth.gaps there must be no gap; with one,
// the requirement decides. Truth that configured faults take away is not missing. With live truth only frames lost
// to errors of a file count as missing. Percentages relate to the truths received, or to the imu's samples. A run
// that `is_repeated` from its record may lack the same as the recorded run.
Outcome judge(const Summary& summary, const Config& config, EndedBy ended_by,
              std::span<const Requirement> requirements, bool is_repeated = false);

}  // namespace imud
