#include "emulator/faults/channel_faults.hpp"

#include "emulator/config.hpp"

namespace imud {

ChannelFaults::ChannelFaults(std::span<const FaultConfig> faults, std::span<const ExpectConfig> expectations,
                             const ImuConfig& imu, std::uint16_t number, std::uint64_t seed, FaultLog& log,
                             std::size_t most)
    : configured_(faults),
      normals_(fault_normals(imu.name, seed, faults.size() + most)),
      schedule_(faults, normals_, imu.name, number, imu.rate_hz, log),
      sensors_(imu.model, normals_),
      messages_(faults, normals_, imu.name, imu.rate_hz),
      expectations_(expectations, imu.name) {}

void ChannelFaults::begin_run() noexcept {
  schedule_.begin_run();
  messages_.discard();
  expectations_.begin_run();
  last_.reset();
}

void ChannelFaults::take(Sample& sample, Nanoseconds since_begin, std::optional<std::int64_t> utc_ns) noexcept {
  schedule_.take(sample, since_begin, utc_ns);
  const double step_s = last_ ? seconds(since_begin - *last_) : 0.0;
  last_ = since_begin;
  sensors_.apply(schedule_.active(FaultSeam::sensor), schedule_.sample(), step_s, sample);
  messages_.take(schedule_.active(FaultSeam::message), schedule_.sample(), sample);
  expectations_.take(schedule_, seconds(since_begin));
}

}  // namespace imud
