// The frame of the throw-away IMU, 24 bytes, little-endian.
#pragma once

#include "protocols/wire/wire.hpp"

namespace imud::throwaway_imu {

struct Wire {
  std::uint8_t start[4];
  boost::endian::little_uint32_buf_t counter;
  boost::endian::little_int32_buf_t rate[3];  // in steps of rate_lsb
  boost::endian::little_uint32_buf_t crc;     // CRC-32C of all before it
};
static_assert(sizeof(Wire) == 24);

constexpr std::uint8_t start[4] = {'T', 'H', 'R', sizeof(Wire)};
constexpr std::size_t crc_offset = offsetof(Wire, crc);
constexpr double rate_lsb = 0x1p-20;  // rad/s
constexpr double rate_range = 100;    // rad/s

}  // namespace imud::throwaway_imu
