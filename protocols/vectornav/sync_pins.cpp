#include "protocols/vectornav/sync_pins.hpp"

#include <utility>

namespace imud::vectornav {

void SyncPins::step_clock(Nanoseconds by) noexcept {
  for (std::optional<DeviceTime>* time : {&last_in_, &last_pulse_, &last_sample_})
    if (*time) *time = **time + by;
}

void SyncPins::edge(const SyncControl& control, PulseSource source, DeviceTime time) noexcept {
  if (source == PulseSource::sync_in) take_pulse(control, time);
  if (control.in == SyncControl::In::none || in_skipped_++ < control.in_skip) return;
  in_skipped_ = 0;
  ++in_count_;
  last_in_ = time;
  has_event_ = true;
}

void SyncPins::pps_edge(const SyncControl& control, PulseSource source, DeviceTime time) noexcept {
  if (source == PulseSource::pps_pin) take_pulse(control, time);
}

void SyncPins::take_pulse(const SyncControl& control, DeviceTime time) noexcept {
  last_pulse_ = time;
  if (control.out == SyncControl::Out::gnss_pulse && has_fix_) trigger_out(control, time);
}

void SyncPins::trigger_out(const SyncControl& control, DeviceTime time) noexcept {
  if (out_skipped_++ < control.out_skip) return;
  out_skipped_ = 0;
  ++out_count_;
  next_pulse_ = Device::Pulse{time, time + control.width};
}

bool SyncPins::sample(const SyncControl& control, PulseSource source, const Sample& sample) noexcept {
  using Out = SyncControl::Out;
  has_fix_ = sample.fix().is_known && source != PulseSource::none;
  if (source == PulseSource::receiver && has_fix_) {
    constexpr std::int64_t second_ns = 1'000'000'000;
    const std::int64_t second = sample.fix().gps_ns / second_ns;
    if (std::exchange(gnss_second_, second).value_or(second) != second) {
      const Nanoseconds age{sample.fix().gps_ns - second * second_ns};
      // A second that began earlier than the last interval is due to a step of GPS time, without a pulse. Twice the
      // interval allows for the error of the sensor's clock relative to GPS time.
      if (last_sample_ && age < 2 * (sample.time - *last_sample_))
        take_pulse(control, sample.time - age);
      else
        last_pulse_ = sample.time - age;
    }
  }
  last_sample_ = sample.time;
  const bool has_event = std::exchange(has_event_, false);
  const bool is_sampled = control.in != SyncControl::In::imu_sample || has_event;
  if (is_sampled && (control.out == Out::imu_start || control.out == Out::imu_ready || control.out == Out::nav_ready))
    trigger_out(control, sample.time);
  pulse_ = std::exchange(next_pulse_, std::nullopt);
  return has_event;
}

SyncStatus SyncPins::status(DeviceTime now) const noexcept {
  SyncStatus status{in_count_, out_count_};
  if (last_in_) status.since_in = now - *last_in_;
  if (last_pulse_) status.since_pulse = now - *last_pulse_;
  return status;
}

}  // namespace imud::vectornav
