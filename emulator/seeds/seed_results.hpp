// The results of replays with many seeds: their summaries.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "emulator/plan/fault_config.hpp"

namespace imud {

// The summaries by seed. Summaries of a seed's imus that ran apart are merged.
class SeedResults {
 public:
  // `keeps`: the summaries are kept for by_seed(). `parts`: the number of parts of each run, which run separately.
  // A fault of `faults` is a shortfall of the run if the fault has begun in no part. If each run has a single
  // part, the summary of this part has these shortfalls already. `faults` must outlive this.
  explicit SeedResults(bool keeps, std::size_t parts = 1, std::span<const FaultConfig> faults = {})
      : keeps_(keeps), parts_(parts), faults_(faults) {}

  // `text`: a JSON array of the summaries of runs. Logs the first ten shortfalls, violated limits and failed
  // expectations of all seeds, and the remarks of the first run. Returns false if a signal has ended one of the runs.
  bool add(const std::string& text);

  int exit_code() const noexcept { return exit_code_; }
  std::uint64_t samples() const noexcept { return samples_; }
  // Returns the labels of all runs, if the summaries have labels, sorted by seed and by part of a run.
  std::string labels(bool as_json) const;
  const std::map<std::uint64_t, nlohmann::ordered_json>& by_seed() const noexcept { return by_seed_; }

 private:
  // How often each fault has begun in the parts of a run so far.
  struct Begun {
    std::size_t parts = 0;
    bool is_whole = true;
    std::vector<std::uint64_t> occurrences;
  };
  bool add_run(nlohmann::ordered_json summary);
  void judge_faults(std::uint64_t seed, nlohmann::ordered_json& summary);

  std::map<std::uint64_t, nlohmann::ordered_json> by_seed_;
  std::map<std::pair<std::uint64_t, std::size_t>, std::string> labels_;  // by seed and part
  const bool keeps_;
  const std::size_t parts_;
  const std::span<const FaultConfig> faults_;
  std::map<std::uint64_t, Begun> begun_;  // by seed, until all parts have come
  bool has_remarks_ = false;              // they are logged
  std::uint64_t samples_ = 0, shortfalls_ = 0;
  int exit_code_ = 0;
};

}  // namespace imud
