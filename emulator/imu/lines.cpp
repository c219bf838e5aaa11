#include "emulator/imu/lines.hpp"

#include <algorithm>
#include <exception>
#include <memory>
#include <utility>

#include "emulator/faults/other_units.hpp"
#include "emulator/imu/wire_port.hpp"

namespace imud {

Lines::Lines(const ImuConfig& config, std::size_t imu, const Ports& ports, const Device& device, StepSink& sink)
    : is_can_(config.protocol->link == Link::can), sink_(sink) {
  using Of = PortUse::Of;
  lines_[0] = {ports({Of::line, imu, 0, config.port, config.port_settings}), device.uart()};
  if (!config.second_port.empty()) {
    lines_[1] = {ports({Of::line, imu, 1, config.second_port, config.second_port_settings}), device.second_uart()};
    count_ = 2;
  }
  look_at_ports();
  copies_ = Copies(config, ports, imu);
  add_interfaces(config.name, sink);
  if (!is_can_) return;
  add_filters(*config.protocol, config.settings, config.rate_hz);
  lines_[0].port->set_filters(can_filters_);
}

void Lines::look_at_ports() noexcept {
  for (DeviceLine& line : all()) line.look_at_port();
  are_files_ = std::ranges::all_of(all(), &DeviceLine::is_file);
  listens_ = std::ranges::any_of(all(), &DeviceLine::listens);
}

void Lines::add_interfaces(const std::string& imu, StepSink& sink) {
  const std::uint16_t link = is_can_ ? link_type::can_socketcan : link_type::bytes;
  for (DeviceLine& line : all()) {
    const std::string name = &line == &lines_[0] ? imu : imu + " second";
    line.interface = sink.add_interface(name, link);
    sink.add_interface(name + " host", link);
    sink.add_interface(name + " dropped", link);
  }
}

// The device's own identifiers pass too, so that the port can confirm its frames and the device detects other users.
void Lines::add_filters(const Protocol& protocol, const Settings& settings, double rate_hz) {
  for (const CanFilter& filter : protocol.can_filters(settings)) can_filters_.push_back(filter);
  for (const CanMessage& message : protocol.can_messages(settings, rate_hz))
    can_filters_.push_back({.id = message.can.id, .extended = message.can.extended});
}

void Lines::enable_faults(const ImuConfig& config, std::uint64_t seed, std::span<const FaultConfig> faults,
                          std::size_t most) {
  for (std::size_t i = 0; i < count_; ++i) {
    const PortSpec spec = PortSpec::parse(i == 0 ? config.port : config.second_port);
    const Transport* transport = find_transport(spec.scheme);
    const PortSettings& settings = i == 0 ? config.port_settings : config.second_port_settings;
    const bool has_rate = transport != nullptr && transport->wire_time != nullptr;
    DeviceLine& line = lines_[i];
    auto wire = std::make_unique<WirePort>(
        std::move(line.port),
        WirePort::Line{.imu = config.name,
                       .number = static_cast<unsigned>(i),
                       .protocol = config.protocol,
                       .rate_hz = config.rate_hz,
                       .uart = line.uart,
                       .bit_rate = has_rate ? transport->wire_time(spec, settings, {}).bit_rate : 0,
                       .most = most,
                       .seal = make_seal(*config.protocol, config.settings)},
        seed);
    line.wire = wire.get();
    line.port = std::move(wire);
    line.wire->set_sink(sink_, line.interface);
    if (i == 0 && !copies_.empty()) line.wire->set_copies(&copies_);
  }
  if (!is_can_) return;
  add_filters(*config.protocol, settings_as_delivered(config), config.rate_hz);
  for (const FaultConfig& fault : faults)
    if (const Settings* settings = fault.settings_of(config.name))
      add_filters(*config.protocol, *settings, config.rate_hz);
  lines_[0].port->set_filters(can_filters_);
}

void Lines::set_faults(std::span<const ActiveFault> faults, DeviceTime time) noexcept {
  for (DeviceLine& line : all()) {
    line.wire->set_time(time);  // the time of other senders' frames, which leave before the device's
    line.wire->set_active(faults);
  }
}

void Lines::send(DeviceLine& line, std::span<const Frame> frames, DeviceTime time, bool is_reply) noexcept {
  const std::uint64_t dropped = line.port->counters().dropped;
  line.send(frames, time, is_reply);
  if (line.wire != nullptr) return;  // the WirePort gives the frames to the sink and to the copies
  // A port that drops frames drops the last of them.
  if (sink_.keeps()) sink_.frames(line.interface, frames, line.port->counters().dropped - dropped);
  if (!copies_.empty() && &line == lines_.data()) copies_.send(frames, time, is_reply);
}

void Lines::set_uarts(const Device& device) noexcept {
  for (std::size_t i = 0; i < count_; ++i) {
    const UartSettings uart = i == 0 ? device.uart() : device.second_uart();
    if (uart == lines_[i].uart) continue;
    lines_[i].uart = uart;
    lines_[i].port->set_line(uart);
    if (i == 0) copies_.set_line(uart);
  }
}

bool Lines::flush() noexcept {
  bool holds_back = copies_.holds_back();
  copies_.flush();
  for (DeviceLine& line : all()) {
    if (!line.holds_back()) continue;
    holds_back = true;
    line.port->flush();
  }
  return holds_back;
}

std::optional<HostTime> Lines::next_flush() const noexcept {
  std::optional<HostTime> first = copies_.next_flush();
  for (const DeviceLine& line : all())
    if (const auto at = line.port->next_flush(); at && (!first || *at < *first)) first = at;
  return first;
}

void Lines::wait_for_room(DeviceLine& line, const std::atomic<bool>& stop) noexcept {
  if (!line.port->has_room()) line.wait(true, stop);
  line.had_room_at = line.passed;
}

bool Lines::wait_until_sent(const std::atomic<bool>& stop) noexcept {
  if (never_waits()) return false;
  for (DeviceLine& line : all()) line.wait(false, stop);
  copies_.wait_until_sent(stop);
  return true;
}

void Lines::discard_pending() noexcept {
  for (DeviceLine& line : all()) line.port->discard_pending();
  copies_.discard_pending();
}

void Lines::commit() {
  std::exception_ptr failure;
  for (const std::span<DeviceLine> lines : {all(), copies_.lines()})
    for (DeviceLine& line : lines) try {
        line.port->commit();
      } catch (const std::exception&) {
        if (!failure) failure = std::current_exception();
      }
  if (failure) std::rethrow_exception(failure);
}

void Lines::exchange(Reload::Line& line) noexcept {
  DeviceLine& own = lines_[line.uart];
  if (own.wire != nullptr) own.wire->set_bit_rate(line.bit_rate);
  if (line.port == nullptr) return;
  line.held = own.passed - own.port->counters().sent - own.port->counters().dropped;
  own.add_to_before();
  own.passed = 0;
  own.had_room_at = ~std::uint64_t{0};
  own.is_stalled = false;
  if (own.wire != nullptr)
    line.held += line.held_of_others = own.wire->exchange(line.port);
  else
    std::swap(own.port, line.port);
  if (line.settings.uart != own.uart) own.port->set_line(own.uart);  // the host has set another one
  look_at_ports();
}

bool Lines::has_new_state(const ImuCounters& counters) const noexcept {
  if (are_files_) return false;
  return lines_[0].port->state() != counters.port_state.load(std::memory_order_relaxed) ||
         (count_ == 2 && lines_[1].port->state() != counters.second_port_state.load(std::memory_order_relaxed));
}

void Lines::publish(ImuCounters& counters, std::uint64_t lost) const noexcept {
  constexpr auto relaxed = std::memory_order_relaxed;
  std::uint64_t sent = replaced_.sent.load(relaxed), replies = replaced_.replies.load(relaxed),
                dropped = replaced_.dropped.load(relaxed) + lost,
                failed = replaced_.failed.load(relaxed) + copies_.failed(), connections_refused = 0;
  for (const DeviceLine& line : all()) {
    const PortCounters &now = line.port->counters(), &before = line.before;
    sent += now.sent + before.sent;
    replies += now.replies + before.replies;
    dropped += now.dropped + before.dropped;
    failed += now.failed + before.failed;
    connections_refused += now.connections_refused + before.connections_refused;
  }
  const Port& port = *lines_[0].port;
  counters.speeds.store(port.speeds(), relaxed);
  counters.port_error.store(port.error(), relaxed);
  if (count_ == 2) {
    const Port& second = *lines_[1].port;
    counters.second_speeds.store(second.speeds(), relaxed);
    counters.second_port_error.store(second.error(), relaxed);
    counters.second_port_state.store(second.state(), std::memory_order_release);
  }
  if (is_can_) publish_bus(counters);
  counters.frames.store(sent - replies, relaxed);
  counters.replies.store(replies, relaxed);
  counters.copies_dropped.store(copies_.dropped(), relaxed);
  counters.dropped.store(dropped, relaxed);
  counters.failed.store(failed, relaxed);
  counters.connections_refused.store(connections_refused, relaxed);
  counters.port_state.store(port.state(), std::memory_order_release);
}

void Lines::publish_bus(ImuCounters& counters) const noexcept {
  constexpr auto relaxed = std::memory_order_relaxed;
  const PortCounters &port = lines_[0].port->counters(), &before = lines_[0].before;
  counters.bus_errors.store(port.bus_errors + before.bus_errors, relaxed);
  counters.error_warnings.store(port.error_warnings + before.error_warnings, relaxed);
  counters.error_passives.store(port.error_passives + before.error_passives, relaxed);
  counters.bus_offs.store(port.bus_offs + before.bus_offs, relaxed);
  counters.bus_restarts.store(port.bus_restarts + before.bus_restarts, relaxed);
  counters.refused.store(port.refused + before.refused, relaxed);
}

}  // namespace imud
