// SeedRun: a replay within a process that does many, whose capture is decoded
// once. Seeds and campaigns share it.
#pragma once

#include <atomic>
#include <chrono>
#include <cstddef>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/requirement.hpp"
#include "core/time.hpp"
#include "emulator/drive/assembly.hpp"
#include "emulator/drive/stored_truths.hpp"
#include "emulator/plan/config.hpp"
#include "emulator/report/summary.hpp"

namespace imud {

// Decodes a capture for many runs. Returns nullopt if each run has to read it,
// because it is too long and can be read again.
std::optional<StoredTruths> store_truths(const TruthConfig& config);

struct SeedRun {
  const StoredTruths* truths = nullptr;  // nullptr: the run reads the capture
  bool repeats = false;                  // truth.port names a record, whose run is repeated
  Assembly::Limits limits = {};
  StepSink* sink = &StepSink::none();
  std::function<void(Engine& engine)> begin = nullptr;  // called when the ports are open, before the first step
  std::chrono::milliseconds readers{50};                // the longest wait for slow readers at the end

  // Runs `config`, whose clock is `fast` or `realtime`, to its end, and then calls `end` with
  // the engine and Assembly::difference(). With `truths`, config.truth.format
  // is their format. Throws PortError.
  void run(const Config& config, const Ports& ports, const std::atomic<bool>& stop,
           const std::function<void(Engine& engine, const std::string& difference)>& end) const;
};

// A run that has ended, and its limits.
struct SeedJudgement {
  const Config& config;
  std::span<const std::unique_ptr<Channel>> channels;  // one for each imu of `config`
  std::span<const double> line_loads;                  // percent, of each imu
  HostTime begin;
  bool is_stopped = false;  // by a signal
  std::span<const Requirement> required = {};
  bool repeats = false;
};
// Returns the summary of a run that has ended, with its outcome, but without
// the outcomes of faults.
Summary judge_run(Engine& engine, const SeedJudgement& run, const std::string& difference);

}  // namespace imud
