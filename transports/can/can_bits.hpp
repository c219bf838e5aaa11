// CanBits: the length of a CAN frame on the bus.
#pragma once

#include <cstddef>

#include "core/frame.hpp"

namespace imud {

// The bits of a frame that are sent at the nominal and at the data bit rate, stuff bits and interframe space
// included.
struct CanBits {
  double nominal = 0, data = 0;
};

// Returns the greatest length that a frame with `bytes` of data can have, whatever its identifier.
CanBits most_can_bits(const CanHeader& header, std::size_t bytes) noexcept;

// Returns the mean length of the frames with this identifier and `bytes` of random data. Data of equal bits, as in
// small numbers or unused bytes, have more stuff bits.
CanBits average_can_bits(const CanHeader& header, std::size_t bytes) noexcept;

// Returns the length of this very frame.
CanBits can_bits(const Frame& frame) noexcept;

}  // namespace imud
