// Pacer: decides when a sample is due, and which truth it samples. The three clocks of a run differ in nothing else.
#pragma once

#include <memory>
#include <optional>

#include "core/time.hpp"
#include "core/timeline.hpp"
#include "emulator/ground/counters.hpp"
#include "emulator/plan/config.hpp"
#include "emulator/truth/truth_clock.hpp"
#include "emulator/truth/truth_monitor.hpp"
#include "emulator/truth/truth_stamps.hpp"

namespace imud {

// Maps the instants at which sensors sample to the truth that they sample. Instants are host times; where the host's
// clock does not pace, they only count from the beginning of the run. No allocation. One thread.
class Pacer {
 public:
  virtual ~Pacer() = default;
  // Returns true if a sample waits for its truth, however long; false if it leaves at its instant in any case.
  virtual bool waits_for_truth() const noexcept = 0;
  // Returns true if samples leave at their instants by the host's clock; false if they leave as soon as their truth
  // has arrived.
  virtual bool is_paced() const noexcept = 0;

  // Replaces the delay of live truth in `realtime`; without effect in the other modes.
  virtual void set_delay(const TruthClock::Options&) noexcept {}

  // Sets how much the epoch's clock is ahead of the host's, for the stamps and instants that follow.
  virtual void set_ahead(Nanoseconds) noexcept {}
  // Takes the stamp of a truth that arrived at `arrival`, before any other function is called for that truth.
  // `begins`: the truth begins a run.
  virtual void take_stamp(const Truth&, HostTime, bool) noexcept {}

  // Called for the first truth, and for one with which simulation time restarts before is_settled(). Returns true if
  // arrivals have to be observed before a run can begin.
  virtual bool begin_settling(TruthTime, HostTime) noexcept { return false; }
  // Returns true if a run can begin with the newest truth.
  virtual bool is_settled(HostTime) noexcept { return true; }
  // Begins a run with `truth`, which arrived at `arrival` and is processed at `now`. Returns the instant at which it
  // is sampled.
  virtual HostTime begin_run(TruthTime truth, HostTime arrival, HostTime now) noexcept = 0;
  // Updates the map by `truth`, the newest of the run, which arrived at `arrival`; the next sample is due at `due`.
  // Returns false if the simulator's time has leapt: `truth` does not continue the truths before it.
  virtual bool observe(TruthTime truth, HostTime arrival, HostTime due) noexcept;
  // Called for a truth that was inserted before the newest.
  virtual void observe_inserted(TruthTime, HostTime) noexcept {}
  // Called when all waiting truths have been observed; the newest is `truth`. Re-anchors the map if the simulator was
  // paused.
  virtual void review(TruthTime truth, HostTime now) noexcept;

  // Returns the truth time that is sampled at `instant`. It never decreases with `instant` within a run.
  virtual TruthTime truth(HostTime instant) const noexcept = 0;
  // Returns truth(`instant`), and fixes the map up to `instant`: truths observed later change it only after
  // `instant`.
  virtual TruthTime use(HostTime instant) noexcept { return truth(instant); }
};

// `lockstep` and `fast`: truth is the clock. A sample leaves as soon as the truth up to its instant has arrived.
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

// `realtime` with a capture as truth: a sample leaves when as much host time as simulation time has passed since the
// run began.
class CapturePacer final : public TruthPacer {
 public:
  bool is_paced() const noexcept override { return true; }
};

// `realtime` with live truth: a sample leaves at its instant by the host's clock, and the TruthClock estimates which
// truth it samples. While truth is missing, the sampled time goes on for as long as motion is extrapolated, and then
// stands still. It goes on where it stood: at once, if the simulator has caught up; otherwise the map is re-anchored
// through the newest truth, and the time goes on when the map reaches it. Writes the estimates to `quality`.
//
// With a given delay, stamps by the epoch's clock take the place of the estimate: an instant samples the truth that
// has the stamp of the instant less the delay, interpolated. If a stamp is too far from the arrival, the estimate is
// used until a stamp is near.
class HostPacer final : public Pacer {
 public:
  // `limits` are the limits of the timeline. The pacer keeps the reference, because they may change while it runs.
  HostPacer(const TruthClock::Options& options, Epoch epoch, const Timeline::Limits& limits,
            TruthQuality& quality) noexcept
      : clock_(options),
        stamps_(epoch),
        has_given_delay_(options.automatic_percent == 0),
        limits_(limits),
        monitor_(limits),
        quality_(quality) {}

  bool waits_for_truth() const noexcept override { return false; }
  bool is_paced() const noexcept override { return true; }
  bool begin_settling(TruthTime truth, HostTime arrival) noexcept override;
  bool is_settled(HostTime now) noexcept override { return clock_.is_settled(now); }
  HostTime begin_run(TruthTime truth, HostTime arrival, HostTime now) noexcept override;
  bool observe(TruthTime truth, HostTime arrival, HostTime due) noexcept override;
  void observe_inserted(TruthTime truth, HostTime arrival) noexcept override {
    clock_.observe_inserted(truth, arrival);
  }
  void review(TruthTime truth, HostTime now) noexcept override;
  void set_delay(const TruthClock::Options& options) noexcept override {
    clock_.set(options);
    has_given_delay_ = options.automatic_percent == 0;
  }
  void set_ahead(Nanoseconds ahead) noexcept override { ahead_ = ahead; }
  void take_stamp(const Truth& truth, HostTime arrival, bool begins) noexcept override;
  TruthTime truth(HostTime instant) const noexcept override;
  TruthTime use(HostTime instant) noexcept override;

 private:
  bool is_mapped_by_stamps() const noexcept { return has_given_delay_ && !stamps_.is_empty(); }
  SharedTime shared(HostTime time) const noexcept { return {(time + ahead_).ns}; }
  TruthTime mapped(HostTime instant) const noexcept;
  bool observe_stamped(TruthTime truth, HostTime arrival, HostTime due) noexcept;
  void add_arrival(TruthTime truth, HostTime arrival, HostTime due) noexcept;
  void remark_stamp(const Truth& truth, TruthStamps::Result result, SharedTime arrival) noexcept;
  void publish() noexcept;
  void anchor_again(TruthTime truth, HostTime arrival) noexcept;
  void report_pause(HostTime now, Nanoseconds behind) noexcept;

  TruthClock clock_;
  TruthStamps stamps_;
  bool has_given_delay_;
  Nanoseconds ahead_{0};
  Nanoseconds shift_{0};   // TruthStamps::Taken, of the newest truth
  Nanoseconds behind_{0};  // the simulator's pauses by its stamps since it was reported
  const Timeline::Limits& limits_;
  TruthMonitor monitor_;
  TruthQuality& quality_;
  bool settling_ = false;
  TruthTime newest_;                   // of all truths of the run
  HostTime newest_arrival_;            // its arrival
  TruthTime reached_;                  // the latest time that was sampled
  bool is_paused_ = false;             // truth is missing for longer than is tolerated, and has not caught up
  HostTime missing_from_;              // the arrival before the pause
  Nanoseconds missing_{0};             // from there to the next arrival; 0: there was none yet
  std::optional<HostTime> held_from_;  // since when the sampled time stands still
};

// Returns the pacer for the configured clock and truth port. `timeline` must outlive the pacer.
std::unique_ptr<Pacer> make_pacer(const Config& config, const Timeline& timeline, TruthQuality& quality);

}  // namespace imud
