// The power of a channel, and the faults that act on its wire, its power and its clock.
#include <chrono>
#include <utility>

#include "emulator/imu/channel.hpp"
#include "transports/host_clock.hpp"

namespace imud {

OwnFigures Channel::figures_of(const ImuModel& model) noexcept {
  const NavigationErrors& errors = model.navigation;
  const auto both = [](const Vector3& slow, const Vector3& white) -> Vector3 {
    return (slow.array().square() + white.array().square()).sqrt();
  };
  return {.g_sensitivity = model.gyro.g_sensitivity,
          .position = both(errors.position, errors.position_noise),
          .velocity = both(errors.velocity, errors.velocity_noise),
          .attitude = errors.attitude};
}

void Channel::add_filters(const Protocol& protocol, const Settings& settings, double rate_hz,
                          std::vector<CanFilter>& filters) {
  for (const CanFilter& filter : protocol.can_filters(settings)) filters.push_back(filter);
  for (const CanMessage& message : protocol.can_messages(settings, rate_hz))
    filters.push_back({.id = message.can.id, .extended = message.can.extended});
}

void Channel::enable_faults(const ImuConfig& config, std::uint64_t seed) {
  for (std::size_t i = 0; i < line_count_; ++i) {
    const PortSpec spec = PortSpec::parse(i == 0 ? config.port : config.second_port);
    const Transport* transport = find_transport(spec.scheme);
    const PortSettings& settings = i == 0 ? config.port_settings : config.second_port_settings;
    const bool has_rate = transport != nullptr && transport->wire_time != nullptr;
    DeviceLine& line = lines_[i];
    auto wire = std::make_unique<WirePort>(
        std::move(line.port),
        WirePort::Line{.imu = name_,
                       .number = static_cast<unsigned>(i),
                       .protocol = config.protocol,
                       .rate_hz = config.rate_hz,
                       .uart = line.uart,
                       .bit_rate = has_rate ? transport->wire_time(spec, settings, {}).bit_rate : 0},
        seed);
    line.wire = wire.get();
    line.port = std::move(wire);
    line.wire->set_sink(sink_, line.interface);
    if (i == 0 && !copies_.empty()) line.wire->set_copies(&copies_);
  }
  const auto utc = std::chrono::system_clock::now().time_since_epoch();
  utc_offset_ns_ = std::chrono::duration_cast<Nanoseconds>(utc).count() - host_now().ns;
  power_faults_.emplace(name_, seed, config.rate_hz);
  const Settings delivered = settings_as_delivered(config);
  other_device_ = config.protocol->make(delivered);
  const auto prepare = [&](Device& device) {
    device.set_figures(figures_of(config.model));
    if (line_count_ == 2) device.connect_second_uart();
  };
  prepare(*other_device_);
  const std::span<const FaultConfig> faults = faults_ ? faults_->configured() : std::span<const FaultConfig>();
  if (OtherUnits::are_needed(faults, config)) {
    auto units = std::make_unique<OtherUnits>(std::move(device_), faults, config, prepare);
    other_units_ = units.get();
    device_ = std::move(units);
  }
  if (is_can_) {
    can_filters_.clear();
    add_filters(*config.protocol, config.settings, config.rate_hz, can_filters_);
    add_filters(*config.protocol, delivered, config.rate_hz, can_filters_);
    for (const FaultConfig& fault : faults)
      if (const Settings* settings = fault.settings_of(config.name))
        add_filters(*config.protocol, *settings, config.rate_hz, can_filters_);
    lines_[0].port->set_filters(can_filters_);
  }
}

std::optional<std::int64_t> Channel::utc_ns_of(DeviceTime time) const noexcept {
  const std::optional<HostTime> host = clock_.host_time(time);
  return host ? std::optional(host->ns + utc_offset_ns_) : std::nullopt;
}

void Channel::cycle_power(HostTime now) noexcept {
  if (!is_on()) return;
  imu_.power_on(++power_ons_);
  start_device(clock_.now(now));
}

void Channel::start_device(DeviceTime now) noexcept {
  device_->power_on(now + clock_offset_);
  apply_uarts();
  apply_filters();
}

void Channel::set_supply(bool on, HostTime now) noexcept {
  if (on == is_supplied_) return;
  if (!on) poll(now);
  is_supplied_ = on;
  counters_.has_power.store(on, std::memory_order_relaxed);
  if (!is_on()) return;
  imu_.power_on(++power_ons_);
  start_device(clock_.now(now));
}

void Channel::set_faults(std::span<const ActiveFault> wire, std::span<const ActiveFault> power) noexcept {
  for (DeviceLine& line : lines()) {
    line.wire->set_time(sample_.time);  // of other senders' frames before its own
    line.wire->set_active(wire);
  }
  next_power_step_ = power_faults_->step(power);
  if (next_power_step_.starts && is_supplied_) imu_.power_on(++power_ons_);
}

bool Channel::apply_power_faults() noexcept {
  power_step_ = next_power_step_;
  if (!power_step_.starts) return false;
  next_power_step_.starts = false;
  if (power_step_.as_delivered && !std::exchange(has_lost_settings_, true))
    std::swap(other_units_ != nullptr ? other_units_->own() : device_, other_device_);
  if (!is_supplied_) return false;
  start_device(sample_.time);
  return true;
}

}  // namespace imud
