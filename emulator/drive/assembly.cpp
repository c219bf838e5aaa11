#include "emulator/drive/assembly.hpp"

#include "emulator/drive/loop.hpp"

namespace imud {

namespace {

std::optional<PaceOptions> pace_of(const Config& config) {
  if (config.clock != ClockMode::realtime) return std::nullopt;
  return PaceOptions{config.realtime.spin, config.realtime.skip_after};
}

std::optional<RecordedRun> record_of(const Config& config, bool repeats) {
  if (!repeats) return std::nullopt;
  return std::optional<RecordedRun>(std::in_place, PortSpec::parse(config.truth.port), config);
}

}  // namespace

Assembly::Assembly(const Config& config, const Ports& ports, const Parts& parts)
    : pace_(pace_of(config)),
      repeated_(record_of(config, parts.repeats)),
      engine_(repeated_ ? repeated_->adapted(config) : config, repeated_ ? repeated_->ports(ports) : ports,
              parts.sink, parts.control),
      pacer_(make_pacer(config, engine_.quality())) {}

void Assembly::run(Host& host, const std::atomic<bool>& stop, const Limits& limits) {
  if (repeated_) return repeated_->run(engine_, host, {pace_, limits.duration, limits.awaits_truth}, stop);
  Loop(engine_, host, *pacer_, {pace_.value_or(PaceOptions{}), limits.duration}, stop).run();
}

}  // namespace imud
