#include "protocols/protocol.hpp"

namespace imud {

void Device::power_on(DeviceTime) noexcept {}
void Device::receive(const Frame&, DeviceTime, FrameBuffer&) noexcept {}
std::optional<DeviceTime> Device::deadline() const noexcept { return std::nullopt; }
void Device::poll(DeviceTime, FrameBuffer&) noexcept {}
void Device::step_clock(Nanoseconds) noexcept {}
void Device::set_figures(const OwnFigures&) noexcept {}
UartSettings Device::uart() const noexcept { return {}; }
void Device::connect_second_uart() noexcept {}
UartSettings Device::second_uart() const noexcept { return {}; }
std::span<const std::uint64_t> Device::counts() const noexcept { return {}; }
std::optional<SensorFilters> Device::filters() const noexcept { return std::nullopt; }
NavigationRequests Device::navigation_requests() const noexcept { return {}; }
void Device::trigger(DeviceTime) noexcept {}
void Device::pps(DeviceTime) noexcept {}
std::optional<Device::Pulse> Device::pulse() const noexcept { return std::nullopt; }

void Decoder::finish(MeasurementSink&) {}

std::unique_ptr<FrameSeal> make_seal(const Protocol& protocol, const Settings& settings) {
  return protocol.make_seal != nullptr ? protocol.make_seal(settings) : nullptr;
}

}  // namespace imud
