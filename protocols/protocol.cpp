#include "protocols/protocol.hpp"

namespace imud {

void Device::receive(const Frame&, FrameBuffer&) noexcept {}
void Device::restart() noexcept {}
LineSettings Device::line() const noexcept { return {}; }

void Decoder::finish(MeasurementSink&) {}

}  // namespace imud
