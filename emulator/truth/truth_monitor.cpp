#include "emulator/truth/truth_monitor.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace imud {

namespace {

using namespace std::chrono_literals;

// A truth that is early by more than this means that the simulator's time has jumped.
constexpr Nanoseconds jump = 250ms;
// Two jumps within this time mean that the simulator runs fast.
constexpr Nanoseconds between_jumps = 1s;
// Truths are late because of a pause, not of a hold-up, if they are late for this long, by at least this much, and
// at least this many in a row.
constexpr Nanoseconds late_for = 100ms;
constexpr Nanoseconds late_by = 50ms;
constexpr int late_truths = 3;
// A simulator that will have caught up within this time is waited for.
constexpr double soon_s = 0.5;

constexpr double slowest = 0.1, fastest = 10;  // limits of the simulator's rate

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

bool TruthMonitor::is_dense() const noexcept { return step_ <= jump; }

Nanoseconds TruthMonitor::tolerated() const noexcept { return std::max({limits_.extrapolate, late_by, 2 * step_}); }

bool TruthMonitor::was_paused(TruthTime truth, TruthTime sampled, HostTime now, double rate) noexcept {
  if (truth - sampled >= -tolerated()) {
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
  if (seconds(sampled - truth) < soon_s * (seen - rate)) return false;
  if (std::abs(seen - rate_) > 0.1 * rate_)
    rate_ = std::clamp(seen, slowest, fastest);  // not a pause: the simulator is slow
  return true;
}

}  // namespace imud
