// The UART settings of a port, from its options or from the device behind it.
#pragma once

#include "core/frame.hpp"
#include "core/uart.hpp"
#include "transports/port.hpp"

namespace imud {

// Returns the device's UART if it has one, else that of the options `baud` (50..4000000; `unset` if absent),
// `parity` (none, even, odd) and `stop` (1, 2). Throws PortError on an option out of its range, even if the device's
// UART replaces it.
UartSettings uart_settings(const PortSpec& spec, const PortSettings& settings, unsigned unset);

// Returns how long the bytes of `frame` take at `baud` bit/s; `bits_per_character` includes start, parity and stop
// bits.
WireTime uart_wire_time(const Frame& frame, unsigned baud, unsigned bits_per_character) noexcept;

}  // namespace imud
