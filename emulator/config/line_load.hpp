// LineLoad: the share of its line or bus that an imu occupies.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "core/frame.hpp"
#include "core/sample.hpp"
#include "emulator/plan/config.hpp"

namespace imud {

struct LineLoad {
  std::size_t frames_per_sample = 0;  // 0 for a product, which sends less often than it samples
  std::size_t bytes_per_sample = 0;   // data bytes on CAN
  double frames_per_s = 0;
  // On the wire (Transport::wire_time), at most, and on average; data bits only if the transport has no wire time.
  // They differ on a CAN bus, whose stuff bits depend on the data. The average is over typical samples, and over
  // random data for an identifier that is not sent with samples.
  double bits_per_s = 0, average_bits_per_s = 0;
  double line_bits_per_s = 0;  // the port's bit rate; 0: it has none
  // Share of the time in which the wire is busy, at most, and on average; 0: no rate.
  double percent = 0, average_percent = 0;
  std::string text() const;  // one line for people
};

// Returns a sample of typical magnitudes. Its numbers have all the digits that a double holds, so that a text format
// makes its longest rows.
Sample typical_sample();

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

// Returns the load of the wire of the port, or of the second port (`uart` 1), by sent_frames(). The imu's protocol
// and that port must be valid.
LineLoad line_load(const ImuConfig& imu, std::uint8_t uart = 0);

// A bus (Transport::is_shared, and it has a bit rate) with the imus on it.
struct BusLoad {
  static constexpr double high_percent = 70;  // above it, frames of low priority wait long
  std::string address;                        // the port without its options
  std::vector<std::size_t> imus;              // indices
  double line_bits_per_s = 0;
  double percent = 0, average_percent = 0;  // as LineLoad, of all imus
  std::string text() const;                 // "45.1 % on average and 52.0 % at most of 500000 bit/s"
};

// Returns the buses of which at least one port gives the bit rate, in the order of their first imu. A port without a
// bit rate gets the rate of the first port with one. The ports and protocols of all imus must be valid.
std::vector<BusLoad> bus_loads(std::span<const ImuConfig> imus);

}  // namespace imud
