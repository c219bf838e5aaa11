// The UART settings of a port, from its options or from the device behind it.
#pragma once

#include "core/frame.hpp"
#include "core/uart.hpp"
#include "transports/port.hpp"

namespace imud {

inline constexpr PortOption baud_option = {
    .key = "baud", .help = "speed of the line, bit/s", .min = 50, .max = 4'000'000};
inline constexpr PortOption parity_option = {
    .key = "parity", .help = "parity of a character", .choices = "none even odd"};
inline constexpr PortOption stop_option = {.key = "stop", .help = "stop bits of a character (1)", .min = 1, .max = 2};

// Returns the UART of the device (PortSettings::uart) if the device has one; otherwise a UART with the options
// `baud` (`unset` if absent), `parity` and `stop`. Throws PortError if an option is out of its range, even if the
// device's UART replaces that option.
UartSettings uart_settings(const PortSpec& spec, const PortSettings& settings, unsigned unset);

// Returns how long the bytes of `frame` take at `baud` bit/s; `bits_per_character` includes start, parity and stop
// bits.
WireTime uart_wire_time(const Frame& frame, unsigned baud, unsigned bits_per_character) noexcept;

}  // namespace imud
