// UartSettings: the settings that both ends of a UART share.
#pragma once

#include <cstdint>

namespace imud {

enum class Parity : std::uint8_t { none, even, odd };

// Characters of eight bits.
struct UartSettings {
  unsigned baud = 0;  // bit/s; 0: no UART, or not said
  Parity parity = Parity::none;
  unsigned stop_bits = 1;

  constexpr unsigned bits_per_character() const noexcept {
    return 1 + 8 + (parity == Parity::none ? 0U : 1U) + stop_bits;
  }
  constexpr bool operator==(const UartSettings&) const = default;
};

}  // namespace imud
