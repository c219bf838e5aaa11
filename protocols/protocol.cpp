#include "protocols/protocol.hpp"

namespace imud {

void Device::receive(const Frame&, FrameBuffer&) noexcept {}
void Device::restart() noexcept {}
LineSettings Device::line() const noexcept { return {}; }
void Device::trigger(DeviceTime) noexcept {}
void Device::pps(DeviceTime) noexcept {}
std::optional<Device::Pulse> Device::pulse() const noexcept { return std::nullopt; }

void Decoder::finish(MeasurementSink&) {}

}  // namespace imud
