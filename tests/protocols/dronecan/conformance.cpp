// The configurations in which DroneCAN is tested, and the inputs from which its fuzz test starts.
#include "tests/protocols/conformance.hpp"

#include <cstdio>
#include <memory>
#include <string>
#include <string_view>

#include "protocols/dronecan/messages.hpp"
#include "protocols/dronecan/services.hpp"

namespace imud::dronecan {
namespace {

using namespace std::string_view_literals;

constexpr ConformanceSettings conformance_settings[] = {
    {"raw_imu_hz=1000 start_up_ms=0"},
    {"raw_imu_hz=1000 start_up_ms=0 timestamp=device solution_hz=500 magnetic_field_hz=500 static_pressure_hz=20 "
     "static_temperature_hz=1 gnss_fix2_hz=100 gnss_auxiliary_hz=100 priority=0",
     [](Protocol& entry) { entry.fields |= Measurement::time; }},
    {"raw_imu_hz=1000 start_up_ms=0 integrals=false",
     [](Protocol& entry) { entry.fields = Measurement::rate | Measurement::specific_force; }},
};

// Each body is a destination, the data type's id, and the payload. Destination 0: a message; 255: requests to all.
constexpr std::string_view host_bodies[] = {
    "\x2A\x01\x00"sv,
    "\x2A\x02\x00\xEB\x03\x01"sv,
    "\x2A\x02\x00\x00\x00\x00uavcan.protocol.param.GetSet"sv,
    "\x2A\x04\x00"sv,
    "\x2A\x05\x00\x1E\x1B\x55\xCE\xAC"sv,
    "\x2A\x06\x00\x40ls"sv,
    "\x2A\x0A\x00\x00\x00\x00\x00\x00\x00\x00"sv,
    "\x2A\x0A\x00\x01\x00\x00\x00\x00\x00\x00"sv,
    "\x2A\x0B\x00\x00\x00"sv,
    "\x2A\x0B\x00\x00\x01\x07\x00\x00\x00\x00\x00\x00\x00node_id"sv,
    "\x2A\x0B\x00\x00\x01\x00\x00\x00\x00\x00\x00\x00\x00node_id"sv,
    "\x2A\x0B\x00\x01\x01\x64\x00\x00\x00\x00\x00\x00\x00"sv,
    "\x2A\x0B\x00\x00\x02\x00\x00\xC0\x3Fpriority"sv,
    "\x2A\x0B\x00\x00\x03\x00integrals"sv,
    "\x2A\x0B\x00\x00\x04\x03textsensor_id"sv,
    "\x2A\x0F\x00\x0A\x00"sv,
    "\x2A\x28\x00\x0A\x66w.bin"sv,
    "\x2A\x2D\x00/"sv,
    "\x2A\x2E\x00\x00\x00\x00\x00/"sv,
    "\x2A\x30\x00\x00\x00\x00\x00\x00/a"sv,
    "\x2A\x31\x00\x00\x00\x00\x00\x00\x02/abc"sv,
    "\x2A\x3F\x00\x00\x00"sv,
    "\x00\x04\x00\x40\x42\x0F\x00\x00\x00\x00"sv,
    "\x00\x01\x00\x54imud\0\0"sv,
    "\x00\x01\x00\x54imud\0\0\0\0\0\0\0\0\0\0\0\x2A"sv,
    "\x00\x55\x01\x07\x00\x00\x00\x48\x00\x00"sv,
};
// Allocates a node id if the stored one is 0, then restores the parameters as delivered, of whatever node id.
constexpr std::string_view revive[] = {"\x00\x01\x00\x54imud\0\0\0\0\0\0\0\0\0\0\0\x2A"sv,
                                       "\xFF\x0A\x00\x01\x00\x00\x00\x00\x00\x00"sv,
                                       "\xFF\x05\x00\x1E\x1B\x55\xCE\xAC"sv};

// Returns the frames of a transfer from node 10 as candump writes them: "1E01AA8A#C3", separated by spaces.
std::string framed(std::string_view body) {
  constexpr unsigned source = 10, all = 0xFF, most = 125;
  static unsigned transfer_id = 0;  // another one each time: a repetition would be discarded
  if (body.size() < 3) return {};
  const auto byte = [&](std::size_t i) { return static_cast<unsigned>(static_cast<unsigned char>(body[i])); };
  const unsigned destination = byte(0);
  Identifier identifier{
      .priority = lowest_priority, .type = byte(1) | byte(2) << 8, .source = source, .is_service = destination != 0};
  DataType type{static_cast<std::uint16_t>(identifier.type), identifier.is_service, 0, ""};
  if (identifier.is_service) {
    identifier.type &= 0xFFU;
    identifier.is_request = true;
    if (const DataType* service = find_service(identifier.type)) type = *service;
  } else if (identifier.type == allocation.id) {
    type = allocation;
  }
  std::string text;
  const auto frames = std::make_unique<FrameBuffer>();
  for (unsigned to = destination == all ? 1 : destination; to <= (destination == all ? most : destination); ++to) {
    frames->clear();
    identifier.destination = to & highest_node_id;
    send(identifier, type, transfer_id % transfer_ids, std::as_bytes(std::span(body.substr(3))), *frames);
    for (const Frame& frame : frames->frames()) {
      char hex[12];
      std::snprintf(hex, sizeof hex, "%08X#", frame.can.id);
      text += hex;
      for (const std::byte one : frame.bytes) {
        std::snprintf(hex, sizeof hex, "%02X", std::to_integer<unsigned>(one));
        text += hex;
      }
      text += ' ';
    }
  }
  ++transfer_id;
  return text;
}
// GetNodeInfo: the seventh frame of the response has the beginning of the name, "org.im".
const Conformance conformance("dronecan", {.settings = conformance_settings,
                                           .host = {.frame = framed,
                                                    .bodies = host_bodies,
                                                    .revive = revive,
                                                    .last = "\x2A\x01\x00"sv,
                                                    .answer = "6F72672E696D"sv}});

}  // namespace
}  // namespace imud::dronecan
