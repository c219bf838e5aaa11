// Replay: runs of imus on a captured truth or run, in this process, as fast as the processor can.
#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "emulator/drive/stored_truths.hpp"
#include "emulator/imu/ports.hpp"
#include "emulator/plan/config.hpp"
#include "emulator/record/twin_rows.hpp"
#include "emulator/truth/capture_check.hpp"

namespace imud {

// This is the only part of the tools that runs an engine. Only the capture is opened, and no port of the
// configuration.
class Replay {
 public:
  // Reads the configuration as `imud replay CONFIG CAPTURE --fast` does, with these overrides KEY=VALUE, and without
  // the pace of lines. Throws ConfigError and PortError.
  Replay(const std::string& config, std::vector<std::string> overrides, const std::string& capture);

  const Config& config() const noexcept { return replay_.config; }
  // Returns the faults of the configuration and, if a record is repeated, the faults that clients began in it. Throws
  // PortError.
  std::vector<FaultConfig> faults() const;

  // Runs `config`, which is config() with other imus, errors, faults or seed; `ports` has the ports of the imus.
  // `awaits_truth`: RecordedRun::Options::awaits_truth. Returns remarks on truth and faults. The capture is decoded
  // once for all runs, unless it is long. Throws PortError, and std::runtime_error if a signal ends the run
  // (stop_requested()).
  std::vector<std::string> run(const Config& config, const Ports& ports,
                               const std::function<void(std::size_t imu)>& awaits_truth = nullptr);
  // Returns run() in the form that truth_of_run() and made_rows() take.
  TwinRun with_twins();

 private:
  ReplayConfig replay_;
  std::optional<StoredTruths> truths_;
  bool is_read_ = false;
};

}  // namespace imud
