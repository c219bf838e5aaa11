#include "emulator/faults/channel_faults.hpp"

#include <algorithm>
#include <utility>

#include "emulator/plan/config.hpp"

namespace imud {

ChannelFaults::ChannelFaults(std::span<const FaultConfig> faults, std::span<const ExpectConfig> expectations,
                             const ImuConfig& imu, std::uint16_t number, std::uint64_t seed, FaultLog& log,
                             std::size_t most)
    : configured_(faults),
      period_(nanoseconds(1 / imu.rate_hz)),
      normals_(fault_normals(imu.name, seed, faults.size() + most)),
      schedule_(faults, normals_, imu.name, number, imu.rate_hz, log),
      sensors_(imu.model, normals_),
      messages_(faults, normals_, imu.name, imu.rate_hz),
      expectations_(expectations, imu.name) {}

void ChannelFaults::begin_run() noexcept {
  if (schedule_.has_taken()) messages_.discard();
  schedule_.begin_run();
  expectations_.begin_run();
  last_.reset();
  held_ = Nanoseconds{0};
}

void ChannelFaults::take(Sample& sample, Nanoseconds since_begin, std::optional<std::int64_t> utc_ns) noexcept {
  has_sample_ = true;
  schedule_.take(sample, since_begin, utc_ns);
  apply(sample, since_begin);
  if (!expectations_.empty()) expectations_.take(schedule_, seconds(since_begin));
}

void ChannelFaults::take_at_rest(Sample& sample, Nanoseconds since, std::optional<std::int64_t> utc_ns) noexcept {
  has_sample_ = true;
  if (!schedule_.has_added()) {
    if (may_act()) remember(sample);
    return;
  }
  schedule_.take_at_rest(sample, since, utc_ns);
  apply(sample, since);
}

// The step of a sample equals the step of the Imu's increments: a nominal period while the simulator stands still.
void ChannelFaults::apply(Sample& sample, Nanoseconds since) noexcept {
  Nanoseconds step = last_ ? since - *last_ : Nanoseconds{0};
  if (last_ && step.count() == 0) {
    step = period_;
    held_ += step;
  } else if (held_.count() > 0) {
    step = std::max(step - std::exchange(held_, Nanoseconds{0}), period_);
  }
  last_ = since;
  const bool acted = std::exchange(acts_, schedule_.acts());
  are_quiet_ = !acted && !acts_;
  if (are_quiet_) {
    if (may_act()) remember(sample);
    return;
  }
  sensors_.apply(schedule_.active(FaultSeam::sensor), schedule_.sample(), seconds(step), sample);
  messages_.take(schedule_.active(FaultSeam::message), schedule_.sample(), sample);
}

}  // namespace imud
