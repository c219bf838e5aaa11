#include "emulator/imu/copies.hpp"

#include <algorithm>

namespace imud {

Copies::Copies(const ImuConfig& config, const Ports& ports, std::size_t imu) {
  for (std::size_t i = 0; i < config.also.size(); ++i) {
    DeviceLine& line = lines_.emplace_back();
    line.port = ports({PortUse::Of::copy, imu, i, config.also[i], config.also_settings[i]});
    line.uart = config.also_settings[i].uart;
    line.look_at_port();
  }
}

void Copies::send(std::span<const Frame> frames, DeviceTime time, bool is_reply) noexcept {
  for (DeviceLine& line : lines_) line.send(frames, time, is_reply);
}

void Copies::set_line(const UartSettings& uart) noexcept {
  for (DeviceLine& line : lines_) {
    line.uart = uart;
    line.port->set_line(uart);
  }
}

void Copies::serve() noexcept {
  constexpr int most = 16;  // pieces, so that a flood does not delay samples
  for (DeviceLine& line : lines_)
    for (int i = 0; i < most && line.listens && line.port->receive(); ++i) {
    }
}

void Copies::flush() noexcept {
  for (DeviceLine& line : lines_)
    if (line.holds_back()) line.port->flush();
}

std::optional<HostTime> Copies::next_flush() const noexcept {
  std::optional<HostTime> first;
  for (const DeviceLine& line : lines_)
    if (const auto at = line.port->next_flush(); at && (!first || *at < *first)) first = at;
  return first;
}

bool Copies::is_drained() noexcept {
  bool all = true;
  for (DeviceLine& line : lines_) all = line.port->is_drained() && all;  // which flushes
  return all;
}

bool Copies::holds_back() const noexcept {
  return std::any_of(lines_.begin(), lines_.end(), [](const DeviceLine& line) { return line.holds_back(); });
}

void Copies::wait_for_room(const std::atomic<bool>& stop) noexcept {
  for (DeviceLine& line : lines_)
    if (!line.is_file && !line.port->has_room()) line.wait(true, stop);
}

void Copies::wait_until_sent(const std::atomic<bool>& stop) noexcept {
  for (DeviceLine& line : lines_) line.wait(false, stop);
}

void Copies::discard_pending() noexcept {
  for (DeviceLine& line : lines_) line.port->discard_pending();
}

std::uint64_t Copies::dropped() const noexcept {
  std::uint64_t sum = 0;
  for (const DeviceLine& line : lines_) sum += line.port->counters().dropped;
  return sum;
}

std::uint64_t Copies::failed() const noexcept {
  std::uint64_t sum = 0;
  for (const DeviceLine& line : lines_) sum += line.port->counters().failed;
  return sum;
}

}  // namespace imud
