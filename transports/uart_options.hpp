// The UART settings of a port, from its options or from the device behind it.
#pragma once

#include "core/frame.hpp"
#include "core/uart.hpp"
#include "transports/port.hpp"

namespace imud {

// Returns the device's UART if it has one, else that of the options `baud` (50..4000000; `unset` if absent), `parity`
// (none, even, odd) and `stop` (1, 2). Throws PortError on an option out of its range, also where the device decides.
UartSettings uart_settings(const PortSpec& spec, const PortSettings& settings, unsigned unset);

// Returns how long the bytes of `frame` take, at `bits_per_character` with start, parity and stop bits.
WireTime uart_wire_time(const Frame& frame, unsigned baud, unsigned bits_per_character) noexcept;

}  // namespace imud
