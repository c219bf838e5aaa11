#include "transports/can_bits.hpp"

namespace imud {

// Classic: 47 bits (11-bit identifier) or 67 bits (29-bit), interframe space included, and the data. At worst every
// fourth of the 34 or 54 bits and the data from start of frame to CRC is followed by a stuff bit (ISO 11898-1;
// Tindell's bound). FD: the same rule holds for the bits before the CRC; the CRC field with its fixed stuff bits is
// sent at the data rate.
CanBits can_bits(const CanHeader& header, std::size_t bytes) {
  const auto n = static_cast<double>(bytes);
  const double id = header.extended ? 20.0 : 0.0;
  if (!header.fd) {
    const double stuffed = 34.0 + id + 8.0 * n;
    return {47.0 + id + 8.0 * n + static_cast<double>(static_cast<int>((stuffed - 1.0) / 4.0)), 0.0};
  }
  const double arbitration = 17.0 + id;                                  // start of frame to bit rate switch
  const double tail = 12.0;                                              // CRC delimiter to interframe space
  const double data = 5.0 + 8.0 * n;                                     // error state, length, data
  const double crc = bytes <= 16 ? 17.0 + 4.0 + 6.0 : 21.0 + 4.0 + 7.0;  // with stuff count and fixed stuff bits
  CanBits bits{arbitration * 1.25 + tail, data * 1.25 + crc};
  if (!header.bit_rate_switch) bits = {bits.nominal + bits.data, 0.0};
  return bits;
}

}  // namespace imud
