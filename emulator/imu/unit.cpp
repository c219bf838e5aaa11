#include "emulator/imu/unit.hpp"

#include <utility>

namespace imud {

Unit::Unit(const ImuConfig& config, ChannelFaults* faults)
    : device_(config.protocol->make(config.settings)), faults_(faults) {
  device_->set_figures(figures_of(config.model));
  if (!config.second_port.empty()) device_->connect_second_uart();
}

OwnFigures Unit::figures_of(const ImuModel& model) noexcept {
  const NavigationErrors& errors = model.navigation;
  const auto both = [](const Vector3& slow, const Vector3& white) -> Vector3 {
    return (slow.array().square() + white.array().square()).sqrt();
  };
  return {.g_sensitivity = model.gyro.g_sensitivity,
          .position = both(errors.position, errors.position_noise),
          .velocity = both(errors.velocity, errors.velocity_noise),
          .attitude = errors.attitude};
}

void Unit::enable_faults(const ImuConfig& config, std::uint64_t seed) {
  power_faults_.emplace(config.name, seed, config.rate_hz);
  other_device_ = config.protocol->make(settings_as_delivered(config));
  const auto prepare = [&](Device& device) {
    device.set_figures(figures_of(config.model));
    if (!config.second_port.empty()) device.connect_second_uart();
  };
  prepare(*other_device_);
  const std::span<const FaultConfig> faults =
      faults_ != nullptr ? faults_->configured() : std::span<const FaultConfig>();
  if (!OtherUnits::are_needed(faults, config)) return;
  auto units = std::make_unique<OtherUnits>(std::move(device_), faults, config, prepare);
  other_units_ = units.get();
  device_ = std::move(units);
}

void Unit::publish(ImuCounters& counters) const noexcept {
  counters.device.store(device_->counts(),
                        other_device_ ? other_device_->counts() : std::span<const std::uint64_t>());
}

bool Unit::cycle_power() noexcept {
  if (!is_supplied_ || !power_faults_) return is_supplied_;
  const bool will_start = next_power_step_.starts && !power_step_.is_on;  // at the next sample's instant
  const bool starts = power_faults_->cycle();
  if (starts && will_start) return false;
  power_step_.is_on = next_power_step_.is_on = starts;
  next_power_step_.starts = next_power_step_.starts && starts;
  return starts;
}

Unit::PowerChange Unit::set_power_faults(std::span<const ActiveFault> faults) noexcept {
  const bool was_on = next_power_step_.is_on;
  next_power_step_ = power_faults_->step(faults);
  if (!is_supplied_) return PowerChange::none;
  if (next_power_step_.starts) return PowerChange::starts;
  return was_on && !next_power_step_.is_on ? PowerChange::goes_off : PowerChange::none;
}

bool Unit::take_power_step() noexcept {
  power_step_ = next_power_step_;
  if (!power_step_.starts) return false;
  next_power_step_.starts = false;
  if (power_step_.as_delivered && !std::exchange(has_lost_settings_, true))
    std::swap(other_units_ != nullptr ? other_units_->own() : device_, other_device_);
  return is_supplied_;
}

void Unit::apply_clock_fault() noexcept {
  const Nanoseconds offset = faults_->messages().clock_offset();
  if (offset == clock_offset_) return;
  device_->step_clock(offset - clock_offset_);
  clock_offset_ = offset;
}

void Unit::take(Sample& sample, bool discarded) noexcept {
  frames_.clear();
  others_.clear();
  if (faults_ != nullptr && faults_->change_frames())
    take_faulty(sample, discarded);
  else if (is_on())
    device_->sample(sample, discarded ? others_ : frames_);
}

void Unit::take_faulty(Sample& sample, bool discarded) noexcept {
  const DeviceTime time = sample.time;
  if (other_units_ != nullptr) other_units_->select(faults_->messages().other_unit());
  if (is_on()) {
    const std::uint64_t counter = sample.counter;
    const std::uint32_t status = sample.status;
    sample.time = time + clock_offset_;
    faults_->messages().forge(sample);
    device_->sample(sample, discarded ? others_ : frames_);
    sample.time = time;
    sample.counter = counter;
    sample.counter_error = 0;
    sample.status = status;
  }
  faults_->messages().shape(frames_, time);
}

void Unit::poll(DeviceTime deadline) noexcept {
  others_.clear();
  device_->poll(deadline + clock_offset_, others_);
}

void Unit::receive(const Frame& frame, DeviceTime now) noexcept {
  others_.clear();
  if (is_on()) device_->receive(frame, now + clock_offset_, others_);
}

bool Unit::exchange(Reload::Sensor& next) noexcept {
  const OwnFigures figures = figures_of(next.model);
  for (const auto* device : {&next.device, &next.delivered_device, &device_, &other_device_})
    if (*device) (*device)->set_figures(figures);
  if (other_units_ != nullptr) other_units_->own()->set_figures(figures);
  if (power_faults_ && next.grid) power_faults_->set_rate(next.model.rate_hz);
  if (next.device == nullptr) return false;
  std::swap(device_, next.device);
  if (other_device_) std::swap(other_device_, next.delivered_device);
  has_lost_settings_ = false;
  return true;
}

}  // namespace imud
