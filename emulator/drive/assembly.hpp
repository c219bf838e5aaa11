// Assembly: the engine, the driver and the ports of one run, put together as the configuration says.
#pragma once

#include <atomic>
#include <deque>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "emulator/drive/pacer.hpp"
#include "emulator/drive/read_ahead.hpp"
#include "emulator/drive/recorded_run.hpp"
#include "emulator/engine/engine.hpp"
#include "emulator/ground/host.hpp"

namespace imud {

// Everything that runs imus makes one of these: the daemon, replays with many seeds, the tools, and tests. The
// driver is the repetition of a record, or a Loop with the pacer of the configured clock and truth port.
class Assembly {
 public:
  struct Parts {
    bool repeats = false;               // truth.port names a record, whose run is repeated
    StepSink& sink = StepSink::none();  // takes the steps of the run
    RunControl* control = nullptr;      // brings commands; nullptr: nobody controls the run
    unsigned threads = 1;  // 2: an EncodingThread makes the frames; 3: a ReadAhead decodes the capture, too
  };
  // Opens every port by `ports`, except for the truth and the input pins of a repeated record. Throws PortError.
  Assembly(const Config& config, const Ports& ports, const Parts& parts);
  Assembly(const Config& config, const Ports& ports) : Assembly(config, ports, Parts()) {}

  Engine& engine() noexcept { return engine_; }
  const Engine& engine() const noexcept { return engine_; }
  // Returns the counters of the epoch's clock.
  const ClockCounters& clock() const noexcept { return clock_; }
  // Returns how many threads the run has: fewer than Parts::threads if it is no `fast` replay of a file, is recorded,
  // or has an imu whose frames cannot be made apart (EncodingThread::serves()).
  unsigned threads() const noexcept { return 1U + (ahead_ ? 1U : 0U) + (encodes_apart_ ? 1U : 0U); }
  // RecordedRun::difference(); empty if no record is repeated.
  std::string difference() const { return repeated_ ? repeated_->difference() : std::string(); }

  struct Limits {
    std::optional<Nanoseconds> duration = std::nullopt;           // of a capture or a record
    std::function<void(std::size_t imu)> awaits_truth = nullptr;  // RecordedRun::Options::awaits_truth
  };
  // Runs to the end of the capture, or of the record, or until `stop` is set. Called once. One thread.
  void run(Host& host, const std::atomic<bool>& stop, const Limits& limits);
  void run(Host& host, const std::atomic<bool>& stop) { run(host, stop, Limits()); }

 private:
  const bool is_paced_;  // by the host's clock
  const PaceOptions pace_;
  const Epoch epoch_;
  const unsigned threads_;  // the number of threads that may be used
  std::optional<RecordedRun> repeated_;
  std::optional<ReadAhead> ahead_;
  std::deque<NormalStock> numbers_;  // of the imus, if encodes_apart_
  Engine engine_;
  ClockCounters clock_;
  const bool encodes_apart_;
  const std::unique_ptr<Pacer> pacer_;
};

}  // namespace imud
