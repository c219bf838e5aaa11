// The data lengths that a CAN FD frame can have, and their codes (DLC). ISO 11898-1, table 5.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace imud {

// The number of data bytes by data length code. A classic frame has at most 8.
inline constexpr std::array<std::uint8_t, 16> fd_lengths = {0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64};

// Returns the code of the shortest CAN FD frame that holds `size` bytes, size <= 64.
constexpr std::uint8_t dlc_of(std::size_t size) noexcept {
  std::uint8_t dlc = 0;
  while (dlc < fd_lengths.size() - 1 && fd_lengths[dlc] < size) ++dlc;
  return dlc;
}

// Returns the number of data bytes of the shortest CAN FD frame that holds `size` bytes, size <= 64.
constexpr std::size_t fd_length(std::size_t size) noexcept { return fd_lengths[dlc_of(size)]; }

}  // namespace imud
