#include "protocols/protocol.hpp"

namespace imud {

void Device::receive(const Frame&, FrameBuffer&) noexcept {}

void Decoder::finish(MeasurementSink&) {}

}  // namespace imud
