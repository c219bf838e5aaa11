#include "emulator/drive/pacer.hpp"

#include <algorithm>
#include <chrono>
#include <limits>
#include <utility>

#include "emulator/truth/remark_text.hpp"

namespace imud {

namespace {
// A longer difference between the stamps of two truths and their simulation time is a pause of the simulator, or a
// leap, and no drift.
constexpr Nanoseconds shortest_pause = std::chrono::milliseconds(50);
}  // namespace

bool Pacer::observe(TruthTime, HostTime, HostTime) noexcept { return true; }
void Pacer::review(TruthTime, HostTime) noexcept {}

bool HostPacer::begin_settling(TruthTime truth, HostTime arrival) noexcept {
  monitor_.begin_run(truth, arrival);
  clock_.begin(truth, arrival, monitor_.rate());
  newest_ = truth;
  newest_arrival_ = arrival;
  is_paused_ = false;
  settling_ = !clock_.is_settled(arrival);
  return settling_;
}

HostTime HostPacer::begin_run(TruthTime truth, HostTime arrival, HostTime now) noexcept {
  HostTime begin;
  if (std::exchange(settling_, false)) {
    const TruthClock::Settled settled = clock_.settle(truth, now);
    begin = settled.begin;
    quality_.settled.interval_s.store(settled.interval_s, std::memory_order_relaxed);
    quality_.settled.jitter_s.store(settled.jitter_s, std::memory_order_relaxed);
    quality_.settled.duration_s.store(settled.duration_s, std::memory_order_relaxed);
    quality_.settled.delay_s.store(clock_.delay_s(), std::memory_order_release);
  } else {
    monitor_.begin_run(truth, arrival);
    begin = clock_.begin(truth, arrival, monitor_.rate());
    // Exact: the first samples are stamped by it.
    if (is_mapped_by_stamps()) begin = begin + (truth - mapped(begin));
  }
  newest_ = truth;
  newest_arrival_ = arrival;
  reached_ = {std::numeric_limits<std::int64_t>::min()};
  is_paused_ = false;
  held_from_.reset();
  publish();
  return begin;
}

TruthTime HostPacer::mapped(HostTime instant) const noexcept {
  return is_mapped_by_stamps() ? stamps_.truth(shared(instant) - clock_.delay(instant)) : clock_.truth(instant);
}

TruthTime HostPacer::truth(HostTime instant) const noexcept {
  if (is_paused_ && !is_mapped_by_stamps()) return reached_;
  return std::max(reached_, std::min(mapped(instant), newest_ + limits_.extrapolate));
}

TruthTime HostPacer::use(HostTime instant) noexcept {
  clock_.use(instant);
  const TruthTime line = mapped(instant);
  reached_ = truth(instant);
  if (line <= newest_ + limits_.extrapolate) {
    if (!is_paused_) held_from_.reset();
    return reached_;
  }
  if (!held_from_) held_from_ = instant;
  if (!is_paused_ && line - newest_ > monitor_.tolerated()) {
    is_paused_ = true;
    missing_from_ = newest_arrival_;
    missing_ = Nanoseconds{0};
  }
  return reached_;
}

bool HostPacer::observe(TruthTime truth, HostTime arrival, HostTime due) noexcept {
  const Nanoseconds step = truth - std::exchange(newest_, truth);
  newest_arrival_ = arrival;
  // More truth may come at once than the timeline keeps. Truth in the timeline is sampled before the rest.
  constexpr int most_kept = static_cast<int>(Timeline::capacity / 4);
  if (is_paused_ && !is_mapped_by_stamps() && truth - reached_ > most_kept * step) reached_ = truth;
  if (is_paused_ && missing_.count() == 0) missing_ = arrival - missing_from_;
  if (is_mapped_by_stamps()) return observe_stamped(truth, arrival, due);
  const TruthTime expected = clock_.truth(arrival) + nanoseconds(clock_.delay_s());
  if (monitor_.has_jumped(truth, arrival, expected)) {
    quality_.resumed.count();
    const bool has_leapt = !monitor_.is_dense();
    if (has_leapt) {
      quality_.last_leap_ns.store((truth - expected).count(), std::memory_order_relaxed);
      quality_.leaps.count();
    }
    anchor_again(truth, arrival);
    return !has_leapt;
  }
  add_arrival(truth, arrival, due);
  return true;
}

void HostPacer::add_arrival(TruthTime truth, HostTime arrival, HostTime due) noexcept {
  // Arrivals that are late because of a pause say nothing about the network.
  if (is_paused_ && clock_.truth(arrival) - truth > monitor_.tolerated()) return;
  // After a hold-up, samples may be due that are older than the arrival.
  clock_.observe(truth, arrival, std::min(arrival, due));
  quality_.jitter.add(clock_.lateness_s());
}

// The stamps show a pause or a leap of the simulator. Either changes the map at once.
bool HostPacer::observe_stamped(TruthTime truth, HostTime arrival, HostTime due) noexcept {
  monitor_.has_jumped(truth, arrival, truth);
  const Nanoseconds shift = std::exchange(shift_, Nanoseconds{0});
  if (std::chrono::abs(shift) <= shortest_pause) {
    add_arrival(truth, arrival, due);
    return true;
  }
  quality_.resumed.count();
  monitor_.begin_run(truth, arrival);
  clock_.resume(truth, arrival, monitor_.rate());
  if (shift.count() > 0) behind_ += shift;
  const bool has_leapt = shift.count() < 0 && !monitor_.is_dense();
  if (has_leapt) {
    is_paused_ = false;
    quality_.last_leap_ns.store(-shift.count(), std::memory_order_relaxed);
    quality_.leaps.count();
  }
  return !has_leapt;
}

void HostPacer::take_stamp(const Truth& truth, HostTime arrival, bool begins) noexcept {
  if (begins) {
    stamps_.clear();
    behind_ = Nanoseconds{0};
  }
  const TruthStamps::Taken taken = stamps_.take(truth.time, truth.stamp, shared(arrival));
  shift_ = taken.shift;
  if (taken.result == TruthStamps::Result::none) return;
  const bool is_used = taken.result == TruthStamps::Result::used;
  if (is_used && has_given_delay_) return quality_.stamped.count();
  if (!is_used) quality_.stamps_refused.count();
  remark_stamp(truth, taken.result, shared(arrival));
}

void HostPacer::remark_stamp(const Truth& truth, TruthStamps::Result result, SharedTime arrival) noexcept {
  using Result = TruthStamps::Result;
  quality_.stamps.set([&](std::span<char> room) {
    switch (result) {
      case Result::other_clock:
        return write_remark(room,
                            "stamps are of the clock \"{}\", which is not realtime.epoch: arrivals map the truth",
                            word_of(epoch_words, truth.stamp.clock));
      case Result::far:
        return write_remark(
            room,
            "the stamp of the truth at {} ns is {:.6f} s {} its arrival: is a clock not set? Arrivals map the truth",
            truth.time.ns, seconds(std::chrono::abs(arrival - truth.stamp.time)),
            truth.stamp.time > arrival ? "after" : "before");
      case Result::not_later:
        return write_remark(room,
                            "the stamp of the truth at {} ns is not later than the stamp before: it is not used",
                            truth.time.ns);
      default:
        return write_remark(room,
                            "truth has stamps, but truth.delay_ms is automatic: arrivals map the truth; give a "
                            "delay, the same on all hosts, to sample the same truth");
    }
  });
}

void HostPacer::review(TruthTime truth, HostTime now) noexcept {
  publish();
  const TruthTime line = mapped(now);
  if (is_mapped_by_stamps()) {
    if (!is_paused_ || line - truth > monitor_.tolerated()) return;
    is_paused_ = false;
    if (missing_ <= monitor_.tolerated()) return;  // a single truth was late
    if (behind_.count() == 0) quality_.caught_up.count();
    report_pause(now, std::exchange(behind_, Nanoseconds{0}));
  } else if (monitor_.was_paused(truth, line, now, clock_.used_rate())) {
    anchor_again(truth, newest_arrival_);
    quality_.resumed.count();
    report_pause(now, line - clock_.truth(now));
  } else if (is_paused_ && line - truth <= monitor_.tolerated()) {
    is_paused_ = false;
    if (missing_ <= monitor_.tolerated()) return;  // it was a single truth that was late
    quality_.caught_up.count();
    report_pause(now, Nanoseconds{0});
  }
}

void HostPacer::anchor_again(TruthTime truth, HostTime arrival) noexcept {
  monitor_.begin_run(truth, arrival);
  clock_.resume(truth, arrival, monitor_.rate());
  is_paused_ = false;
}

// `behind`: by how much the sampled time is later than it would have been.
void HostPacer::report_pause(HostTime now, Nanoseconds behind) noexcept {
  const Nanoseconds ahead = reached_ - mapped(now);  // the time stands still until the map reaches it
  const Nanoseconds held = now - held_from_.value_or(now) + std::max(ahead, Nanoseconds{0});
  quality_.last_missing_ns.store(missing_.count(), std::memory_order_relaxed);
  quality_.last_held_ns.store(held.count(), std::memory_order_relaxed);
  quality_.last_behind_ns.store(behind.count(), std::memory_order_relaxed);
  quality_.pauses.fetch_add(1, std::memory_order_release);
}

void HostPacer::publish() noexcept {
  quality_.rate.store(clock_.rate(), std::memory_order_relaxed);
  quality_.offset_s.store(clock_.offset_s(), std::memory_order_relaxed);
  quality_.delay_s.store(clock_.delay_s(), std::memory_order_relaxed);
  quality_.delay_raises.store(clock_.delay_raises(), std::memory_order_relaxed);
  quality_.known.store(true, std::memory_order_relaxed);
}

std::unique_ptr<Pacer> make_pacer(const Config& config, const Timeline& timeline, TruthQuality& quality) {
  if (config.clock != ClockMode::realtime) return std::make_unique<TruthPacer>();
  if (is_capture(config.truth.port)) return std::make_unique<CapturePacer>();
  return std::make_unique<HostPacer>(config.truth.clock, epoch_of(config), timeline.limits(), quality);
}

}  // namespace imud
