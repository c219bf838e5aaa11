// UartSettings: the settings that both ends of a UART share.
#pragma once

#include <cstdint>

namespace imud {

enum class Parity : std::uint8_t { none, even, odd };

// The settings of a UART with characters of eight data bits.
struct UartSettings {
  unsigned baud = 0;  // bit/s; 0 if there is no UART, or the rate is not given
  Parity parity = Parity::none;
  unsigned stop_bits = 1;  // 1 or 2

  // Returns the number of bits on the wire for one character, with start, parity and stop bits.
  constexpr unsigned bits_per_character() const noexcept {
    return 1 + 8 + (parity == Parity::none ? 0U : 1U) + stop_bits;
  }
  constexpr bool operator==(const UartSettings&) const = default;
};

}  // namespace imud
