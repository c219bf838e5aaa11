// The bits of a classic CAN frame as a controller sends them: a reference for the calculated lengths.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "core/frame.hpp"

namespace imud {

// ISO 11898-1: fields, CRC-15 (polynomial 0x4599), a stuff bit after five equal bits from start of frame to CRC.
class CanSerialiser {
 public:
  explicit CanSerialiser(const CanHeader& header, std::span<const std::byte> data) {
    put(0, 1);
    if (header.extended) {
      put(header.id >> 18U, 11);
      put(3, 2);
      put(header.id & 0x3FFFFU, 18);
      put(header.remote ? 1 : 0, 1);
      put(0, 2);
    } else {
      put(header.id, 11);
      put(header.remote ? 1 : 0, 1);
      put(0, 2);
    }
    put(static_cast<std::uint32_t>(data.size()), 4);
    if (!header.remote)
      for (const std::byte byte : data) put(std::to_integer<std::uint32_t>(byte), 8);
    std::uint32_t crc = 0;
    for (const bool bit : bits_) {
      const bool feedback = bit != ((crc & 0x4000U) != 0);
      crc = (crc << 1U) & 0x7FFFU;
      if (feedback) crc ^= 0x4599U;
    }
    this->crc = static_cast<std::uint16_t>(crc);
    put(crc, 15);
  }

  // Returns the length on the bus: with stuff bits, CRC delimiter, acknowledgement, end of frame and interframe
  // space.
  int length() const { return static_cast<int>(bits_.size()) + stuff_bits() + 1 + 2 + 7 + 3; }

  int stuff_bits() const {
    int count = 0, run = 0;
    bool last = true;
    for (const bool bit : bits_) {
      run = run > 0 && bit == last ? run + 1 : 1;
      last = bit;
      if (run < 5) continue;
      ++count;
      last = !bit;
      run = 1;
    }
    return count;
  }

  std::uint16_t crc = 0;

 private:
  void put(std::uint32_t value, int width) {
    for (int i = width - 1; i >= 0; --i) bits_.push_back(((value >> static_cast<unsigned>(i)) & 1U) != 0);
  }

  std::vector<bool> bits_;
};

}  // namespace imud
