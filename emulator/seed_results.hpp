// The results of replays with many seeds: their summaries, and the progress.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>

#include "core/time.hpp"

namespace imud {

// Returns the worse of two exit codes: 1 is worse than 3, and 3 than 0.
int worse_exit_code(int a, int b) noexcept;

// The summaries by seed; those of a seed's imus, which ran apart, are merged.
class SeedResults {
 public:
  // `keeps`: by_seed() is wanted.
  explicit SeedResults(bool keeps) : keeps_(keeps) {}

  // `text`: a JSON array of the summaries of runs. Logs what is missing, of the first seeds, and the remarks of the
  // first run. Returns false if a signal has ended one of them.
  bool add(const std::string& text);

  int exit_code() const noexcept { return exit_code_; }
  std::uint64_t samples() const noexcept { return samples_; }
  // The labels of all runs, if the summaries have them: by seed, and by part of a run.
  std::string labels(bool as_json) const;
  const std::map<std::uint64_t, nlohmann::ordered_json>& by_seed() const noexcept { return by_seed_; }

 private:
  bool add_run(nlohmann::ordered_json summary);

  std::map<std::uint64_t, nlohmann::ordered_json> by_seed_;
  std::map<std::pair<std::uint64_t, std::size_t>, std::string> labels_;  // by seed and part
  const bool keeps_;
  bool has_remarks_ = false;  // they are logged
  std::uint64_t samples_ = 0, shortfalls_ = 0;
  int exit_code_ = 0;
};

// The line of progress on standard error: rewritten on a terminal, otherwise logged every five seconds.
class SeedProgress {
 public:
  SeedProgress(std::size_t runs, bool quiet);
  ~SeedProgress();
  SeedProgress(const SeedProgress&) = delete;
  SeedProgress& operator=(const SeedProgress&) = delete;
  void show(std::size_t done);

 private:
  const std::size_t runs_;
  const bool quiet_, is_terminal_;
  const HostTime begin_;
  HostTime shown_;
};

}  // namespace imud
