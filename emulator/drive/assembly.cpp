#include "emulator/drive/assembly.hpp"

#include <filesystem>
#include <system_error>

#include "emulator/drive/loop.hpp"

namespace imud {

namespace {

std::optional<RecordedRun> record_of(const Config& config, bool repeats) {
  if (!repeats) return std::nullopt;
  return std::optional<RecordedRun>(std::in_place, PortSpec::parse(config.truth.port), config);
}

// Returns whether a run may use several threads. A fifo or standard input, also beside a file of the name -, would
// keep a thread waiting for another process, and a record needs the packets of the truth.
bool may_use_threads(const Config& config, const Assembly::Parts& parts) {
  if (config.clock != ClockMode::fast || parts.repeats || parts.sink.keeps() || !is_capture(config.truth.port))
    return false;
  std::error_code error;
  const std::string address = PortSpec::parse(config.truth.port).address;
  return address != "-" && std::filesystem::is_regular_file(address, error);
}

// Returns the configuration of a run that takes its truth from `ahead`.
Config reading_from(const ReadAhead& ahead, Config config) {
  config.truth.format = &ahead.format();
  return config;
}

Ports reading_from(ReadAhead& ahead, const Ports& ports) {
  return [&ahead, ports](const PortUse& use) { return use.of == PortUse::Of::truth ? ahead.open() : ports(use); };
}

}  // namespace

Assembly::Assembly(const Config& config, const Ports& ports, const Parts& parts)
    : is_paced_(config.clock == ClockMode::realtime),
      pace_{config.realtime.spin, config.realtime.skip_after},
      epoch_(epoch_of(config)),
      threads_(may_use_threads(config, parts) ? parts.threads : 1),
      repeated_(record_of(config, parts.repeats)),
      ahead_(threads_ > 2 ? std::optional<ReadAhead>(std::in_place, config.truth) : std::nullopt),
      engine_(repeated_ ? repeated_->adapted(config)
              : ahead_  ? reading_from(*ahead_, config)
                        : config,
              repeated_ ? repeated_->ports(ports)
              : ahead_  ? reading_from(*ahead_, ports)
                        : ports,
              parts.sink, parts.control),
      encodes_apart_(threads_ > 1 && EncodingThread::serves(engine_.channels())),
      pacer_(make_pacer(config, engine_.timeline(), engine_.quality())) {}

void Assembly::run(Host& host, const std::atomic<bool>& stop, const Limits& limits) {
  if (repeated_) {
    const std::optional<PaceOptions> pace = is_paced_ ? std::optional(pace_) : std::nullopt;
    return repeated_->run(engine_, host, {pace, limits.duration, limits.awaits_truth}, stop);
  }
  std::optional<EncodingThread> encoding;
  if (encodes_apart_) {
    const std::size_t imus = engine_.channels().size();
    for (const auto& channel : engine_.channels())
      channel->sensor.imu().take_numbers_from(numbers_, EncodingThread::batch_size / imus + 1);
    engine_.encode_by(&encoding.emplace(imus, stop, numbers_));
  }
  Loop(engine_, host, *pacer_, {pace_, limits.duration, epoch_}, clock_, stop).run();
  engine_.encode_by(nullptr);
}

}  // namespace imud
