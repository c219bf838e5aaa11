// Counts the frames that an imu sends, says whether their bytes carry a quantity, and computes the share of its line
// or bus that they occupy.
#pragma once

#include <cstdint>
#include <set>
#include <span>
#include <vector>

#include "core/frame.hpp"
#include "core/sample.hpp"
#include "emulator/plan/config.hpp"
#include "emulator/plan/line_load.hpp"

namespace imud {

// Returns a sample of typical magnitudes. Its numbers have all the digits that a double holds, so that a text format
// makes its longest rows.
Sample typical_sample();

// Returns true if the imu's protocol transmits these bits of Sample::status.
bool carries_status(const ImuConfig& imu, std::uint32_t bits);
// Returns false if the imu's protocol never sends a value that depends on place, magnetic field or pressure.
bool carries_place(const ImuConfig& imu);
// Returns true if the imu is known to measure a magnetic field or a pressure, or to have a receiver, and to send
// this quantity. Requires a valid imu.
bool needs_place(const ImuConfig& imu);
// Returns false if, with the imu's settings, an error of the time stamps changes no byte that the imu sends. A
// product whose protocol can send the time is treated as if it sent the time. Requires a valid protocol of the
// imu.
bool carries_stamp(const ImuConfig& imu);

// Frames of one kind that an imu sends.
struct SentFrames {
  CanHeader can;
  std::size_t bytes = 0;
  double per_s = 0;
};

// Returns all frames that an imu sends. On a CAN bus these are the identifiers that its protocol lists, at their
// highest rates. Otherwise its protocol encodes typical samples: the samples of a product's second second, after its
// start-up, or one sample of any other protocol. The imu's protocol must be valid. `uart`: only frames with this
// Frame::uart.
std::vector<SentFrames> sent_frames(const ImuConfig& imu, std::uint8_t uart = 0);

// Returns the CAN identifiers that the imu sends and that no host assigns. The identifiers of extended frames have
// bit 31 set. Empty for links other than CAN. Requires a valid protocol of the imu.
std::set<std::uint32_t> fixed_identifiers(const ImuConfig& imu);

// Returns the load of the wire of the port, or of the second port (`uart` 1), computed from sent_frames(). For a
// product this computes two seconds of samples; ImuConfig keeps the load that was computed when the configuration
// was read. Requires that the imu's protocol and that port are valid.
LineLoad line_load(const ImuConfig& imu, std::uint8_t uart = 0);

// Returns the buses of which at least one port gives the bit rate, in the order of their first imu. A port without a
// bit rate gets the rate of the first port with one. The ports and protocols of all imus must be valid.
std::vector<BusLoad> bus_loads(std::span<const ImuConfig> imus);

}  // namespace imud
