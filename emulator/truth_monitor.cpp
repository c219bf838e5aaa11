#include "emulator/truth_monitor.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace imud {

namespace {

using namespace std::chrono_literals;

// No network and no clock brings a truth this much early: the simulator's time has jumped.
constexpr Nanoseconds jump = 250ms;
// Two jumps within this time are a simulator that runs fast.
constexpr Nanoseconds between_jumps = 1s;
// Truths that come late for this long are no hold-up; by this much at least, and this many.
constexpr Nanoseconds late_for = 200ms;
constexpr Nanoseconds late_by = 50ms;
constexpr int late_truths = 3;

constexpr double slowest = 0.1, fastest = 10;  // simulators that are followed

}  // namespace

void TruthMonitor::begin_run(TruthTime truth, HostTime arrival) noexcept {
  begun_ = arrival;
  begun_with_ = newest_ = truth;
  late_since_.reset();
}

bool TruthMonitor::has_jumped(TruthTime truth, HostTime arrival, TruthTime expected) noexcept {
  step_ = truth - std::exchange(newest_, truth);
  const Nanoseconds since_begin = arrival - begun_;
  if (truth - expected <= jump) {
    if (since_begin > between_jumps) has_jumped_ = false;
    return false;
  }
  if (std::exchange(has_jumped_, true) && since_begin < between_jumps && since_begin.count() > 0)
    rate_ = std::clamp(seconds(truth - begun_with_) / seconds(since_begin), slowest, fastest);
  return true;
}

bool TruthMonitor::was_paused(TruthTime truth, TruthTime sampled, HostTime now, double rate) noexcept {
  // A simulator that sends seldom is late by much now and then.
  const Nanoseconds tolerated = std::max({extrapolate_, late_by, 2 * step_});
  if (truth - sampled >= -tolerated) {
    late_since_.reset();
    rate_ = rate;
    return false;
  }
  if (!late_since_) {
    late_since_ = now;
    late_from_ = truth;
    late_count_ = 1;
    return false;
  }
  if (++late_count_ < late_truths || now - *late_since_ < late_for) return false;
  const double seen = seconds(truth - late_from_) / seconds(now - *late_since_);
  if (std::abs(seen - rate_) > 0.1 * rate_) rate_ = std::clamp(seen, slowest, fastest);  // no pause: it is slow
  return true;
}

}  // namespace imud
