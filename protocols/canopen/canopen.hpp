// A CANopen slave (CiA 301 version 4.2) with the objects of an inertial unit: the declarations shared by the device
// (device.cpp), its object dictionary (object_dictionary.cpp, measured.cpp), SDO server (sdo_server.cpp), process
// data (pdo.cpp), emergencies (emergency.cpp), supervision (supervision.cpp), LSS (lss.cpp), settings (settings.cpp)
// and decoder (decoder.cpp). imud.eds describes the object dictionary for masters and tools.
//
// | identifier     | message                          | identifier     | message                                    |
// |----------------|----------------------------------|----------------|--------------------------------------------|
// | 0x000          | NMT command, node                | 0x580 + node   | SDO: answer                                |
// | 1005 (0x080)   | SYNC, perhaps with a counter     | 0x600 + node   | SDO: request                               |
// | 1014 (0x080 +) | EMCY                             | 0x700 + node   | boot-up, heartbeat; remote: node guarding  |
// | 1012 (0x100)   | TIME                             | 0x7E5          | LSS: request                               |
// | 1800 (0x180 +) | TPDO1 to TPDO4, 0x100 apart      | 0x7E4          | LSS: answer                                |
//
// All numbers are little-endian. Comments name an object by its index in hexadecimal digits, such as 1017, and by its
// subindex, such as 1018:4.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <span>

#include "core/frame.hpp"
#include "protocols/wire/deadlines.hpp"
#include "protocols/wire/wire.hpp"

namespace imud::canopen {

inline constexpr Nanoseconds inhibit_unit = std::chrono::microseconds(100);  // of inhibit times

inline constexpr unsigned last_node_id = 127;
inline constexpr unsigned unconfigured = 255;  // the node id of a slave that waits for LSS

// The base identifiers of messages with a node id.
inline constexpr std::uint32_t nmt_id = 0, emcy_id = 0x080, first_tpdo_id = 0x180, sdo_answer_id = 0x580,
                               sdo_request_id = 0x600, heartbeat_id = 0x700, lss_answer_id = 0x7E4,
                               lss_request_id = 0x7E5;

// Bits of a COB-ID object (1005, 1012, 1014, 1800:1).
inline constexpr std::uint32_t can_id_bits = 0x7FF, extended_bit = 1U << 29, bit_30 = 1U << 30, bit_31 = 1U << 31;

// The state of the device (NMT), with the values of a heartbeat.
enum class State : std::uint8_t { booting = 0, stopped = 4, operational = 5, pre_operational = 127 };

// The deadlines at which the device acts on its own. If several are due, the device acts in this order.
enum class Alarm : std::uint8_t {
  boot,
  sdo_timeout,
  sdo_block,  // more segments of a block upload
  consumer_1,
  consumer_2,
  consumer_3,
  consumer_4,
  life_guarding,
  sync_loss,
  emergency,  // the inhibit time has passed
  heartbeat,
  count
};
using Alarms = Deadlines<Alarm>;
inline constexpr unsigned consumers = 4;

// Appends a frame of at most 8 bytes.
inline void send(std::uint32_t id, std::span<const std::byte> data, FrameBuffer& out) noexcept {
  out.append(data, {.id = id});
}

}  // namespace imud::canopen
