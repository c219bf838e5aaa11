// LineLoad: how much of its line or bus an imu takes.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/frame.hpp"
#include "core/sample.hpp"
#include "emulator/config.hpp"

namespace imud {

struct LineLoad {
  std::size_t frames_per_sample = 0;
  std::size_t bytes_per_sample = 0;  // data bytes on CAN
  double frames_per_s = 0;           // of a product, instead of these two
  double bits_per_s = 0;             // on the wire, with start, parity and stop bits, or with worst-case stuff bits
  double line_bits_per_s = 0;        // what the port is configured for; 0: it has no rate
  double percent = 0;                // 0 if the line has no rate
  std::string text() const;          // one line for people
};

// Of ordinary magnitude, every digit used.
Sample ordinary_sample();

// From an ordinary sample, encoded by the imu's own protocol. The imu's protocol and port are valid.
LineLoad line_load(const ImuConfig& imu);

// The identifiers of one sample's frames.
std::vector<CanHeader> can_headers(const ImuConfig& imu);

// The longest that a frame of `bytes` data can be on the bus, in bits at the nominal and at the data rate.
struct CanBits {
  double nominal = 0, data = 0;
};
CanBits can_bits(const CanHeader& header, std::size_t bytes);

}  // namespace imud
