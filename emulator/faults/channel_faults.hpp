// ChannelFaults: all faults of one imu, at the places where they act.
#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "emulator/faults/expectations.hpp"
#include "emulator/faults/fault_schedule.hpp"
#include "emulator/faults/message_faults.hpp"
#include "emulator/faults/sensor_faults.hpp"

namespace imud {

struct ImuConfig;

// No allocation after construction; one thread.
class ChannelFaults {
 public:
  // The run's `faults` and `expectations` must outlive this. `most`: the number of faults that may be added.
  // `number`: the imu's number.
  ChannelFaults(std::span<const FaultConfig> faults, std::span<const ExpectConfig> expectations, const ImuConfig& imu,
                std::uint16_t number, std::uint64_t seed, FaultLog& log, std::size_t most = 0);

  FaultSchedule& schedule() noexcept { return schedule_; }
  // Adds a fault as FaultSchedule::add() does, after the sample `last`.
  void add(const FaultConfig& fault, std::uint32_t number, const Sample& last) noexcept {
    if (schedule_.empty() && has_sample_) remember(last);
    schedule_.add(fault, number);
  }
  // Returns true if no fault acts on the last sample, and none acted on the sample before. Then the lists of active
  // faults are empty, and have not changed with this sample.
  bool are_quiet() const noexcept { return are_quiet_; }
  // Returns true if the frames of the last sample have to go through messages().
  bool change_frames() const noexcept { return !are_quiet_ || messages_.holds_back(); }
  // Returns true if a fault may act on the next sample. Otherwise take() does not need `utc_ns`.
  bool may_act() const noexcept { return !schedule_.empty(); }
  // The faults of the run that were there at its start.
  std::span<const FaultConfig> configured() const noexcept { return configured_; }
  // The number of faults of the wire that may act at once: the configured ones, and 64 that control begins.
  std::size_t most() const noexcept {
    constexpr std::size_t most_by_control = 64;
    return configured_.size() + std::min(normals_.size() - configured_.size(), most_by_control);
  }
  void begin_run() noexcept;
  // The next sample has no increments.
  void pass_over() noexcept { last_.reset(); }
  // Ends the faults that act, after the last sample.
  void finish() noexcept { schedule_.finish(); }
  // Determines the faults of a sample of the truth, `since_begin` after the begin of its run, and applies the faults
  // of the sensors and of the device's input. `utc_ns`: as for FaultSchedule::take().
  void take(Sample& sample, Nanoseconds since_begin, std::optional<std::int64_t> utc_ns) noexcept;
  // Does the same as take() for a sample at rest, before the first truth: only faults that were begun by control act.
  // `since` is the time since power on.
  void take_at_rest(Sample& sample, Nanoseconds since, std::optional<std::int64_t> utc_ns) noexcept;
  // The host has sent bytes, after the last sample.
  void host_sent(std::span<const std::byte> bytes) noexcept {
    schedule_.host_sent(bytes);
    expectations_.host_sent(bytes);
  }
  // SensorFaults::exchange_model().
  void exchange_model(ImuModel& model) noexcept { sensors_.exchange_model(model); }
  // Sets the rate of the samples from the next one on.
  void set_rate(double rate_hz) noexcept {
    period_ = nanoseconds(1 / rate_hz);
    schedule_.set_rate(rate_hz);
  }
  // The faults that change, delay or drop messages.
  MessageFaults& messages() noexcept { return messages_; }
  // The expectations about the host of the imu.
  Expectations& expectations() noexcept { return expectations_; }
  const Expectations& expectations() const noexcept { return expectations_; }
  std::span<const ActiveFault> active(FaultSeam seam) const noexcept { return schedule_.active(seam); }

 private:
  void apply(Sample& sample, Nanoseconds since) noexcept;
  // Keeps the sample for faults that begin with the next one.
  void remember(const Sample& sample) noexcept {
    sensors_.remember(sample);
    messages_.remember(sample);
  }

  const std::span<const FaultConfig> configured_;
  Nanoseconds period_;
  const std::vector<Normals> normals_;  // by the faults' numbers
  FaultSchedule schedule_;
  SensorFaults sensors_;
  MessageFaults messages_;
  Expectations expectations_;
  bool has_sample_ = false;
  bool acts_ = false;  // a fault acts on the last sample
  bool are_quiet_ = true;
  std::optional<Nanoseconds> last_;  // the time of the last sample of this run
  Nanoseconds held_{0};              // for how long samples have had that time
};

}  // namespace imud
