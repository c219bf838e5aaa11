// TruthClock: where the simulator's time lies on the host's, estimated from arrivals.
#pragma once

#include <array>
#include <cstddef>

#include "core/time.hpp"

namespace imud {

// A truth cannot arrive before it is sent: all arrivals lie late of one straight line, host time over truth time, and
// the least late ones lie on it. The line is the edge of their lower convex hull at the middle of the last 4 s: it
// lies below all, and nearest to all on the mean (Zhang, Liu, Xia, "Clock synchronization algorithms for network
// measurements", INFOCOM 2002). Its slope is the simulator's rate; the offset is that of the last half second's least
// late arrival, so that a simulator whose rate wanders is followed. Offset and delay are approached by slewing, 5 %
// at most each, never by a step; a rate that cannot be told from 1 is 1.
//
// Allocates nothing. One thread.
class TruthClock {
 public:
  struct Options {
    Nanoseconds delay{0};          // how far behind the line the sensors sample
    double automatic_percent = 0;  // above 0: found from the arrivals instead, see delay()
  };
  explicit TruthClock(const Options& options) noexcept;

  // A run begins: `truth`, which came at `arrival`, is what the sensors sample when the delay has passed since.
  // Returns when that is. The simulator's rate is `rate` until the run has shown its own.
  HostTime begin(TruthTime truth, HostTime arrival, double rate) noexcept;
  // Another truth of the run came, the newest of all, and is looked at `now`.
  void observe(TruthTime truth, HostTime arrival, HostTime now) noexcept;

  // What the sensors sample at `time`. Rises with it.
  TruthTime truth(HostTime time) const noexcept;
  // The same; no later slewing will change what was so used.
  TruthTime use(HostTime time) noexcept;

  // Truth seconds per host second, as estimated: 0.1 to 10.
  double rate() const noexcept { return measured_rate_; }
  // The one that is gone by: exactly 1 where the estimate does not tell it from 1.
  double used_rate() const noexcept { return rate_; }
  // By how much the simulator's time has fallen behind the host's since begin(), s.
  double offset_s() const noexcept { return offset_s_; }
  // s of truth time. Automatic: at each arrival, how much would have been just enough for the sensors to interpolate
  // all the while since the one before; of the last 512 such, what is enough for automatic_percent, taken at once if
  // more, gradually if less.
  double delay_s() const noexcept { return delay_s_; }
  // How late the last truth observed came, relative to the line, s.
  double lateness_s() const noexcept { return lateness_s_; }

  static constexpr double largest_slew = 0.05;

 private:
  struct Point {
    double truth_s = 0;  // since begin()'s
    double host_s = 0;
  };
  void add(const Point& arrival) noexcept;
  void fit() noexcept;
  void need(double delay_s) noexcept;
  double line_at(HostTime time) const noexcept;
  double delay_at(HostTime time) const noexcept;
  void go_to(HostTime time) noexcept;
  const Point& point(std::size_t i) const noexcept { return points_[(first_ + i) % points_.size()]; }

  const Options options_;
  TruthTime truth_origin_;  // of begin()
  HostTime host_origin_;

  // The least late arrival of each block of time; the newest block's may still be replaced.
  std::array<Point, 64> points_;
  std::size_t first_ = 0;
  std::size_t count_ = 0;
  double slope_ = 1;  // the line: host_s = slope * truth_s + intercept
  double intercept_s_ = 0;
  double measured_rate_ = 1;
  double offset_s_ = 0;
  double lateness_s_ = 0;

  double delay_s_ = 0;
  std::array<double, 512> needs_;
  std::size_t need_count_ = 0;
  double last_truth_s_ = 0;

  // The line as the sensors know it: rate_ from the anchor on, and the correction in the course of slew_s_. They
  // sample that less the applied delay, which approaches delay_s_.
  HostTime anchor_;
  double line_s_ = 0;  // at the anchor, since truth_origin_
  double rate_ = 1;
  double correction_s_ = 0;
  double slew_s_ = 1;
  double applied_delay_s_ = 0;
};

}  // namespace imud
