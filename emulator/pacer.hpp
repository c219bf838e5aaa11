// Pacer: decides when a sample is due, and of which truth. The three clocks of a run differ in nothing else.
#pragma once

#include <memory>

#include "core/time.hpp"
#include "emulator/config.hpp"
#include "emulator/counters.hpp"
#include "emulator/truth_clock.hpp"
#include "emulator/truth_monitor.hpp"

namespace imud {

// Maps the instants at which sensors sample to the truth that they sample. Instants are host times; where no host
// clock paces they are only counted from the run's begin. No allocation. One thread.
class Pacer {
 public:
  virtual ~Pacer() = default;
  // True if a sample waits for its truth, however long; false if it leaves at its instant in any case.
  virtual bool waits_for_truth() const noexcept = 0;
  // True if samples leave at their instants by the host's clock; false: as soon as their truth is there.
  virtual bool is_paced() const noexcept = 0;

  // A run begins with `truth`, which arrived at `arrival`; it is `now`. Returns the instant at which it is sampled.
  virtual HostTime begin_run(TruthTime truth, HostTime arrival, HostTime now) noexcept = 0;
  // `truth` is the newest of the run and arrived at `arrival`; the next sample is due at `due`. Returns false if the
  // simulator's time has jumped, so that a new run must begin.
  virtual bool observe(TruthTime truth, HostTime arrival, HostTime due) noexcept;
  // All truths that had waited are observed, the newest is `truth`. Returns false if the simulator was paused, so
  // that a new run must begin.
  virtual bool review(TruthTime truth, HostTime now) noexcept;

  // The truth that is sampled at `instant`. Rises with it.
  virtual TruthTime truth(HostTime instant) const noexcept = 0;
  // The same; what was so used is not changed any more by truths observed later.
  virtual TruthTime use(HostTime instant) noexcept { return truth(instant); }
};

// `lockstep` and `fast`: truth is the clock. A sample leaves as soon as the truth up to its instant is there.
class TruthPacer : public Pacer {
 public:
  bool waits_for_truth() const noexcept final { return true; }
  bool is_paced() const noexcept override { return false; }
  HostTime begin_run(TruthTime truth, HostTime, HostTime now) noexcept final {
    run_truth_ = truth;
    return run_begin_ = now;
  }
  TruthTime truth(HostTime instant) const noexcept final { return run_truth_ + (instant - run_begin_); }

 private:
  TruthTime run_truth_;
  HostTime run_begin_;
};

// `realtime` with a capture as truth: each sample leaves when as much host time has passed since the run's begin as
// simulation time.
class CapturePacer final : public TruthPacer {
 public:
  bool is_paced() const noexcept override { return true; }
};

// `realtime` with live truth: a sample leaves at its instant by the host's clock, and the TruthClock estimates which
// truth it samples. Writes what it
// estimates of the simulator's clock to `quality`.
class HostPacer final : public Pacer {
 public:
  HostPacer(const TruthClock::Options& options, Nanoseconds extrapolate, TruthQuality& quality) noexcept
      : clock_(options), monitor_(extrapolate), quality_(quality) {}

  bool waits_for_truth() const noexcept override { return false; }
  bool is_paced() const noexcept override { return true; }
  HostTime begin_run(TruthTime truth, HostTime arrival, HostTime now) noexcept override;
  bool observe(TruthTime truth, HostTime arrival, HostTime due) noexcept override;
  bool review(TruthTime truth, HostTime now) noexcept override;
  TruthTime truth(HostTime instant) const noexcept override { return clock_.truth(instant); }
  TruthTime use(HostTime instant) noexcept override { return clock_.use(instant); }

 private:
  void publish() noexcept;

  TruthClock clock_;
  TruthMonitor monitor_;
  TruthQuality& quality_;
};

// The pacer of the configured clock: truth's for `fast` and `lockstep`, a capture's or the host's for `realtime`.
std::unique_ptr<Pacer> make_pacer(const Config& config, TruthQuality& quality);

}  // namespace imud
