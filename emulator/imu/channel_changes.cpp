// The changes that commands make to a Channel, and the sample that it offers to the feed.
#include <algorithm>
#include <utility>

#include "emulator/imu/channel.hpp"

namespace imud {

void Channel::pause(bool paused) noexcept {
  paused_ = paused;
  counters_.is_paused.store(paused, std::memory_order_relaxed);
}

void Channel::execute(const Command& command, const FaultBook& faults, HostTime now) noexcept {
  const auto axis = static_cast<std::size_t>(command.number % 3);
  const auto fault = static_cast<std::uint32_t>(command.number);
  switch (command.kind) {
    case Command::Kind::power_off:
    case Command::Kind::power_on:
      set_supply(command.kind == Command::Kind::power_on, now);
      break;
    case Command::Kind::power_cycle:
      set_supply(false, now);
      set_supply(true, now);
      break;
    case Command::Kind::pause:
    case Command::Kind::resume:
      pause(command.kind == Command::Kind::pause);
      break;
    case Command::Kind::fault_begin:
      if (faults_ && faults[fault].acts_on(name_)) faults_->schedule().add(faults[fault], fault);
      break;
    case Command::Kind::fault_end:
      if (faults_) faults_->schedule().end(fault);
      break;
    case Command::Kind::fault_clear:
      if (faults_) faults_->schedule().end_all();
      break;
    case Command::Kind::seed:
      imu_.set_seed(command.number);
      break;
    case Command::Kind::gyro_bias:
      set_bias(Quantity::rate, axis, command.value);
      break;
    case Command::Kind::accelerometer_bias:
      set_bias(Quantity::specific_force, axis, command.value);
      break;
    default:
      break;
  }
}

void Channel::set_bias(Quantity quantity, std::size_t axis, double bias) noexcept {
  Vector3 all = imu_.bias(quantity);
  all[static_cast<Eigen::Index>(axis)] = bias;
  imu_.set_bias(quantity, all);
}

void Channel::exchange_device(Reload::Sensor& sensor, HostTime now) noexcept {
  if (sensor.device == nullptr) return;
  if (is_on()) poll(now);
  std::swap(device_, sensor.device);
  if (other_device_) std::swap(other_device_, sensor.delivered_device);
  has_lost_settings_ = false;
  if (is_on()) start_device(clock_.now(now));
}

void Channel::exchange_sensor(Reload::Sensor& sensor, HostTime now) noexcept {
  if (sensor.keeps_gyro_bias) sensor.imu.set_bias(Quantity::rate, imu_.bias(Quantity::rate));
  if (sensor.keeps_accelerometer_bias)
    sensor.imu.set_bias(Quantity::specific_force, imu_.bias(Quantity::specific_force));
  if (device_filters_) sensor.imu.set_filters(filters_);
  sensor.imu.continue_from(imu_);
  std::swap(imu_, sensor.imu);
  awaited_.set_mounting(sensor.model);
  const OwnFigures figures = figures_of(sensor.model);
  for (const auto* device : {&sensor.device, &sensor.delivered_device})
    if (*device) (*device)->set_figures(figures);
  exchange_device(sensor, now);
  device_->set_figures(figures);
  if (other_device_) other_device_->set_figures(figures);
  if (other_units_ != nullptr) other_units_->own()->set_figures(figures);
  if (faults_) faults_->exchange_model(sensor.model);
  if (!sensor.grid) return;
  grid_ = *sensor.grid;
  clock_.change(grid_);
  if (!faults_) return;
  const double rate_hz = imu_.rate_hz();
  faults_->set_rate(rate_hz);
  power_faults_->set_rate(rate_hz);
  for (DeviceLine& line : lines()) line.wire->set_rate(rate_hz);
}

void Channel::exchange_port(Reload::Line& line) noexcept {
  DeviceLine& own = lines_[line.uart];
  if (own.wire != nullptr) own.wire->set_bit_rate(line.bit_rate);
  if (line.port == nullptr) return;
  line.held = own.passed - own.port->counters().sent - own.port->counters().dropped;
  own.add_to_before();
  own.passed = 0;
  own.is_stalled = false;
  if (own.wire != nullptr)
    line.held += line.held_of_others = own.wire->exchange(line.port);
  else
    std::swap(own.port, line.port);
  if (line.settings.uart != own.uart) own.port->set_line(own.uart);  // the host has set another one
  own.is_file = !own.port->can_receive() && own.port->descriptor() < 0;
  are_files_ = std::all_of(lines().begin(), lines().end(), [](const DeviceLine& one) { return one.is_file; });
  publish();
}

void Channel::count_replaced(std::uint64_t sent, std::uint64_t replies, std::uint64_t dropped,
                             std::uint64_t failed) noexcept {
  replaced_.sent.fetch_add(sent, std::memory_order_relaxed);
  replaced_.replies.fetch_add(replies, std::memory_order_relaxed);
  replaced_.dropped.fetch_add(dropped, std::memory_order_relaxed);
  replaced_.failed.fetch_add(failed, std::memory_order_relaxed);
}

FeedSample Channel::feed_sample() const noexcept {
  const auto count = [](const Counter& counter) { return counter.load(std::memory_order_relaxed); };
  const Eigen::Quaternionf q = sample_.q_LP.cast<float>();
  const Eigen::Vector3f field = sample_.magnetic_field.cast<float>();
  const Navigation& place = sample_.navigation;
  return {.imu = number_,
          .status = sample_.status,
          .k = sample_.counter,
          .time_ns = sample_.time.ns,
          .truth_time = is_resting_ ? std::nullopt : used_until(),
          .is_sent = !is_discarded_ && !paused_ && is_on(),
          .temperature_c = sample_.temperature_c,
          .rate = sample_.rate,
          .specific_force = sample_.specific_force,
          .true_rate = imu_.true_rate(),
          .true_specific_force = imu_.true_specific_force(),
          .extrapolated = count(counters_.extrapolated),
          .held = count(counters_.held),
          .silent = count(counters_.silent),
          .attitude = {q.w(), q.x(), q.y(), q.z()},
          .magnetic_field = {field.x(), field.y(), field.z()},
          .pressure = static_cast<float>(sample_.pressure),
          .has_place = place.is_known,
          .latitude = place.latitude,
          .longitude = place.longitude,
          .height = place.height};
}

}  // namespace imud
