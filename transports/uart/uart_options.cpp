#include "transports/uart/uart_options.hpp"

namespace imud {

UartSettings uart_settings(const PortSpec& spec, const PortSettings& settings, unsigned unset) {
  UartSettings uart;
  uart.baud = static_cast<unsigned>(spec.integer(baud_option).value_or(unset));
  const std::string parity = spec.one_of(parity_option);
  uart.parity = parity == "even" ? Parity::even : parity == "odd" ? Parity::odd : Parity::none;
  uart.stop_bits = static_cast<unsigned>(spec.integer(stop_option).value_or(1));
  return settings.uart.baud != 0 ? settings.uart : uart;
}

WireTime uart_wire_time(const Frame& frame, unsigned baud, unsigned bits_per_character) noexcept {
  WireTime time;
  time.bits = time.average_bits = time.own_bits = static_cast<double>(frame.bytes.size()) * bits_per_character;
  time.bit_rate = baud;
  if (baud != 0) time.seconds = time.average_seconds = time.own_seconds = time.bits / baud;
  return time;
}

}  // namespace imud
