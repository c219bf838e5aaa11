#include "emulator/pacer.hpp"

#include <algorithm>
#include <utility>

namespace imud {

bool Pacer::observe(TruthTime, HostTime, HostTime) noexcept { return true; }
bool Pacer::review(TruthTime, HostTime) noexcept { return true; }

bool HostPacer::begin_settling(TruthTime truth, HostTime arrival) noexcept {
  monitor_.begin_run(truth, arrival);
  clock_.begin(truth, arrival, monitor_.rate());
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
  }
  publish();
  return begin;
}

bool HostPacer::observe(TruthTime truth, HostTime arrival, HostTime due) noexcept {
  if (monitor_.has_jumped(truth, arrival, clock_.truth(arrival) + nanoseconds(clock_.delay_s()))) return false;
  // After a hold-up, samples may be due that are older than the arrival.
  clock_.observe(truth, arrival, std::min(arrival, due));
  quality_.jitter.add(clock_.lateness_s());
  return true;
}

bool HostPacer::review(TruthTime truth, HostTime now) noexcept {
  publish();
  return !monitor_.was_paused(truth, clock_.truth(now), now, clock_.used_rate());
}

void HostPacer::publish() noexcept {
  quality_.rate.store(clock_.rate(), std::memory_order_relaxed);
  quality_.offset_s.store(clock_.offset_s(), std::memory_order_relaxed);
  quality_.delay_s.store(clock_.delay_s(), std::memory_order_relaxed);
  quality_.delay_raises.store(clock_.delay_raises(), std::memory_order_relaxed);
  quality_.known.store(true, std::memory_order_relaxed);
}

std::unique_ptr<Pacer> make_pacer(const Config& config, TruthQuality& quality) {
  if (config.clock != ClockMode::realtime) return std::make_unique<TruthPacer>();
  if (is_capture(config.truth.port)) return std::make_unique<CapturePacer>();
  return std::make_unique<HostPacer>(config.truth.clock, config.truth.limits.extrapolate, quality);
}

}  // namespace imud
