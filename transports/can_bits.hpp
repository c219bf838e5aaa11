// CanBits: the length of a CAN frame on the bus.
#pragma once

#include <cstddef>

#include "core/frame.hpp"

namespace imud {

// The bits of a frame that are sent at the nominal and at the data bit rate.
struct CanBits {
  double nominal = 0, data = 0;
};

// Returns the greatest length that a frame with `bytes` of data can have, stuff bits and interframe space included.
CanBits can_bits(const CanHeader& header, std::size_t bytes);

}  // namespace imud
