// LineSettings: what both ends of a UART must agree on.
#pragma once

#include <cstdint>

namespace imud {

enum class Parity : std::uint8_t { none, even, odd };

// Characters of eight bits.
struct LineSettings {
  unsigned baud = 0;  // bit/s; 0: no UART, or not said
  Parity parity = Parity::none;
  unsigned stop_bits = 1;

  constexpr unsigned bits_per_character() const noexcept {
    return 1 + 8 + (parity == Parity::none ? 0U : 1U) + stop_bits;
  }
  constexpr bool operator==(const LineSettings&) const = default;
};

}  // namespace imud
