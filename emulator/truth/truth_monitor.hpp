// TruthMonitor: detects from the arrivals of the truth that the simulator has paused, or that its time has leapt.
#pragma once

#include <optional>

#include "core/time.hpp"
#include "core/timeline.hpp"

namespace imud {

// Watches a live stream of truth beside the TruthClock. The clock tracks small deviations. The monitor detects
// deviations that neither a network nor a scheduler causes. After these the map of the clock is re-anchored. No
// allocation. One thread.
class TruthMonitor {
 public:
  // `limits`: the timeline's, which may change. A truth is late if it is later than motion is extrapolated.
  explicit TruthMonitor(const Timeline::Limits& limits) noexcept : limits_(limits) {}

  // Begins a run with `truth`, which arrived at `arrival`, or goes on with it after the map was re-anchored.
  void begin_run(TruthTime truth, HostTime arrival) noexcept;

  // Called for the newest truth of the run, which arrived at `arrival`; `expected` is the latest truth time that can
  // arrive then. Returns true if the truth is so early that the map has to be re-anchored.
  bool has_jumped(TruthTime truth, HostTime arrival, TruthTime expected) noexcept;
  // Returns true if the truth of the last has_jumped() followed the truth before it closely: the simulator runs fast,
  // and its time has not leapt.
  bool is_dense() const noexcept;
  // Returns the lateness above which a truth counts as late. At a low truth rate, a single truth may be late by much.
  Nanoseconds tolerated() const noexcept;
  // Called when all waiting truths have been taken; the newest is `truth`. At `now` the sensors sample `sampled`,
  // and the clock runs at `rate` truth seconds per host second. Returns true if truth has been late for so long that
  // the simulator was paused, or is slower than estimated, and that it will not have caught up soon.
  bool was_paused(TruthTime truth, TruthTime sampled, HostTime now, double rate) noexcept;

  // The simulator's rate with which the map has to be re-anchored, truth seconds per host second.
  double rate() const noexcept { return rate_; }

 private:
  const Timeline::Limits& limits_;
  TruthTime newest_;
  Nanoseconds step_{0};  // from the truth before the newest
  HostTime begun_;       // when the run's first truth arrived
  TruthTime begun_with_;
  bool has_jumped_ = false;  // a jump was less than 1 s ago
  std::optional<HostTime> late_since_;
  TruthTime late_from_;
  int late_count_ = 0;
  double rate_ = 1;
};

}  // namespace imud
