// TruthClock: maps host time to the simulator's time, by an estimate from the arrivals of truths.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "core/time.hpp"
#include "emulator/plan/truth_delay.hpp"

namespace imud {

// A truth cannot arrive before it is sent. Plotted as host time over truth time, all arrivals therefore lie on or
// above one straight line, and the arrivals of lowest latency lie on it. The estimate of the line is the edge of the
// lower convex hull of the arrivals at the middle of the last 4 s: no arrival lies below it, and the mean distance to
// all is the smallest (Zhang, Liu, Xia, "Clock synchronization algorithms for network measurements", INFOCOM 2002).
// The inverse of its slope is the simulator's rate. The arrival of lowest latency in the last 4 s gives the offset,
// which jitter hardly moves. If the simulator's rate changes, and arrivals of the last second contradict the offset,
// the last half second gives it. The map is corrected by slewing, offset and delay by 5 % at most each, never
// by a step. A rate that differs from 1 by less than its uncertainty is taken as 1.
//
// An automatic delay is settled before the first run: from begin() on the arrivals are only observed, until
// is_settled(); then settle() fixes the delay, so that the sensors sample an undistorted motion from the first sample
// on. Later the delay is raised, slewed by 0.2 to 5 %, if more arrivals than `automatic_percent` allows for were too
// late. It is lowered by 50 us a second, the drift of a poor crystal, if it is more than a quarter too long.
//
// Allocates nothing. One thread.
class TruthClock {
 public:
  using Options = TruthDelay;
  explicit TruthClock(const Options& options) noexcept;

  // Replaces the options; the map slews to the new delay.
  void set(const Options& options) noexcept;

  // Begins a run with `truth`, which arrived at `arrival`. Returns the instant at which the sensors sample it, which
  // is later than `arrival` by the delay. The simulator's rate is taken as `rate` for the first 0.2 s of arrivals.
  HostTime begin(TruthTime truth, HostTime arrival, double rate) noexcept;
  // Re-anchors the map through the arrival, after a pause or a leap of the simulator: the delay stays as it is.
  HostTime resume(TruthTime truth, HostTime arrival, double rate) noexcept { return begin(truth, arrival, rate); }
  // Updates the estimate by the newest truth of the run, which arrived at `arrival` and is processed at `now`.
  void observe(TruthTime truth, HostTime arrival, HostTime now) noexcept;

  // Returns true if the delay is given or settled, or can be settled: 200 ms after begin() if at least 16 truths have
  // arrived with at most 1 ms of jitter, otherwise 1 s after it.
  bool is_settled(HostTime now) noexcept;
  // Fixes the automatic delay: the longest that an arrival since begin() has needed, from 16 arrivals on the second
  // longest, and a quarter of their spread and 0.5 ms more. The map begins with `truth`, the newest, which is sampled
  // at Settled::begin, at `now` or later.
  struct Settled {
    HostTime begin;
    double interval_s, jitter_s, duration_s;  // the usual step of the truths, the spread of the delays, since begin()
  };
  Settled settle(TruthTime truth, HostTime now) noexcept;
  // Takes into account that `truth` has arrived after a later one.
  void observe_inserted(TruthTime truth, HostTime arrival) noexcept;

  // Returns the truth time that the sensors sample at `time`. It never decreases with `time`.
  TruthTime truth(HostTime time) const noexcept;
  // Returns truth(`time`), and fixes the map up to `time`: later observations change it only after `time`.
  TruthTime use(HostTime time) noexcept;

  // The estimated rate, truth seconds per host second: 0.1 to 10.
  double rate() const noexcept { return measured_rate_; }
  // The rate of the map: exactly 1 where the estimate differs from 1 by less than its uncertainty.
  double used_rate() const noexcept { return rate_; }
  // The time by which the simulator has fallen behind the host's clock since begin(), s.
  double offset_s() const noexcept { return offset_s_; }
  // The delay, s of truth time, to which the map's delay is slewed. Automatic: at most 1 s, see above.
  double delay_s() const noexcept { return delay_s_; }
  // How often the automatic delay was raised after it was settled.
  std::uint64_t delay_raises() const noexcept { return delay_raises_; }
  // Returns the map's delay at `time`. Once the map has slewed to a given delay, this is that delay to the
  // nanosecond.
  Nanoseconds delay(HostTime time) const noexcept { return nanoseconds(delay_at(time)); }
  // The latency of the last truth observed, relative to the line, s.
  double lateness_s() const noexcept { return lateness_s_; }

  static constexpr double largest_slew = 0.05;

 private:
  struct Point {
    double truth_s = 0;  // since truth_origin_
    double host_s = 0;   // since host_origin_
  };
  // Returns false if the arrival changes none of points_.
  bool add(const Point& arrival) noexcept;
  void fit() noexcept;
  // An arrival needs the delay that would have avoided extrapolation before it.
  void add_need(double host_s, double known_s) noexcept;
  double need_s(double host_s, double known_s) const noexcept { return (host_s - intercept_s_) / slope_ - known_s; }
  void follow_needs(double host_s) noexcept;
  struct Enough {
    double delay_s, margin_s, jitter_s;
  };
  Enough enough(std::size_t outliers) const noexcept;
  Enough enough_to_settle() noexcept;
  double line_at(HostTime time) const noexcept;
  double delay_at(HostTime time) const noexcept;
  void move_anchor(HostTime time) noexcept;
  const Point& point(std::size_t i) const noexcept { return points_[(first_ + i) % points_.size()]; }

  Options options_;
  TruthTime truth_origin_;  // of begin()
  HostTime host_origin_;

  // The arrival of lowest latency in each block of time. The newest block's arrival may still be replaced.
  std::array<Point, 64> points_;
  std::size_t first_ = 0;
  std::size_t count_ = 0;
  double slope_ = 1;  // the line: host_s = slope * truth_s + intercept
  double intercept_s_ = 0;
  double measured_rate_ = 1;
  double offset_s_ = 0;
  double lateness_s_ = 0;

  bool has_steady_offset_ = false;
  double fitted_host_s_ = 0;  // the arrival of the last fit()

  double delay_s_ = 0;
  double delay_slew_ = largest_slew;  // s of delay per s
  bool is_settled_ = false;
  struct Need {
    double host_s, known_s;  // of the arrival; the motion was known up to there before it
  };
  std::array<Need, 512> arrivals_;  // a ring, until the delay is settled: the line may still change
  std::array<double, 512> needs_;   // s, a ring, afterwards
  std::size_t need_count_ = 0;      // since begin()
  double followed_host_s_ = 0;      // when follow_needs() was called last
  std::uint64_t delay_raises_ = 0;
  double last_truth_s_ = 0;
  double step_s_ = 0;  // the shortest from truth to truth, since begin()

  // The map: from the anchor on, truth time rises at rate_, and additionally by correction_s_, spread over slew_s_.
  // The sensors sample this time less the applied delay, which slews towards delay_s_.
  HostTime anchor_;
  double line_s_ = 0;  // at the anchor, since truth_origin_
  double rate_ = 1;
  double correction_s_ = 0;
  double slew_s_ = 1;
  double applied_delay_s_ = 0;
};

}  // namespace imud
