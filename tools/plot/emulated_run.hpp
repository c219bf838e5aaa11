// EmulatedRun: the output of a configured sensor on a captured truth, decoded from the sensor's bytes, with and
// without its errors.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "tools/allan/still_recording.hpp"
#include "tools/plot/solution_rows.hpp"
#include "tools/replay/replay.hpp"

namespace imud {

// Runs one imu of a configuration, and decodes the frames that it sends.
class EmulatedRun {
 public:
  struct Options {
    std::string config;                  // path of the configuration
    std::string capture;                 // of the truth, as for `imud replay`
    std::string imu;                     // name; empty: the first
    std::vector<std::string> overrides;  // KEY=VALUE
    std::optional<double> rate_hz;       // in place of the rate of the samples' time, or of the settings
    bool is_truth_filtered = false;      // the truth passes the sensor's own filters, and is as late as its values
  };

  // Reads the configuration. Throws as Replay does, and std::invalid_argument if the configuration has no such
  // imu.
  explicit EmulatedRun(Options options);

  const std::string& name() const noexcept { return config_.imus.front().name; }
  std::uint64_t seed() const noexcept { return config_.seed; }
  // Returns true if the imu computes a solution by a filter of its own.
  bool has_solution() const noexcept { return config_.imus.front().navigator.is_on; }

  // Return the output with this seed, and without any error: the truth at the sensor's place, in its axes, samples
  // and format. Throw as Replay::run() does, and std::runtime_error if the output is no recording. The first run
  // reports warnings and remarks on standard error.
  StillRecording sent(std::uint64_t seed);
  StillRecording truth();
  // Require has_solution(). Return the solution of each sample, with this seed and with the faults of the
  // configuration, and the true one.
  std::vector<SolutionRow> solution(std::uint64_t seed);
  std::vector<SolutionRow> true_solution();

 private:
  std::vector<SolutionRow> solutions(const Config& config);
  StillRecording record(const Config& config);

  Options options_;
  Replay replay_;
  Config config_;  // with the selected imu alone
  bool has_run_ = false;
};

}  // namespace imud
