#include "emulator/pacer.hpp"

#include <algorithm>

namespace imud {

bool Pacer::observe(TruthTime, HostTime, HostTime) noexcept { return true; }
bool Pacer::review(TruthTime, HostTime) noexcept { return true; }

HostTime HostPacer::begin_run(TruthTime truth, HostTime arrival, HostTime) noexcept {
  monitor_.begin_run(truth, arrival);
  const HostTime begin = clock_.begin(truth, arrival, monitor_.rate());
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
  quality_.known.store(true, std::memory_order_relaxed);
}

std::unique_ptr<Pacer> make_pacer(const Config& config, TruthQuality& quality) {
  if (config.clock != ClockMode::realtime) return std::make_unique<TruthPacer>();
  if (is_capture(config.truth.port)) return std::make_unique<CapturePacer>();
  return std::make_unique<HostPacer>(config.truth.clock, config.truth.limits.extrapolate, quality);
}

}  // namespace imud
