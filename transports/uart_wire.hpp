// UartWire: what a UART receives of characters that were sent at another speed than its own.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "core/uart.hpp"

namespace imud {

// Whether two UARTs understand one another: by the middle of the stop bit the slower one is less than half a bit
// behind.
constexpr bool understand(unsigned baud, unsigned other, const UartSettings& characters) noexcept {
  const std::uint64_t bits = 10 + (characters.parity == Parity::none ? 0 : 1);  // to the end of the first stop bit
  const std::uint64_t fast = baud > other ? baud : other, slow = baud > other ? other : baud;
  return (2 * bits - 1) * fast < 2 * bits * slow;
}

// The wire as wave forms: idle 1, start bit 0, data bits, least significant first, parity, stop bits 1. The receiver
// waits for a falling edge and samples the middle of each bit at its own speed; a start bit that is none by then is
// noise. A character whose stop bit is missing comes as sampled, a break as 0: what a tty gives whose client has not
// set INPCK (termios(3); n_tty_receive_parity_error() in Linux' n_tty.c). Parity is not checked, as there.
class UartWire {
 public:
  // Most characters received for one sent: so many falling edges it has.
  static constexpr std::size_t most = 5;

  // `sender.baud` and `receiver_baud` from 50 to 4'000'000. A change forgets the character under way.
  void set(const UartSettings& sender, unsigned receiver_baud) noexcept;

  // Sends characters back to back, at once after those of the call before. Returns how many were received by their
  // end, put into `received`; those for which there is no room are lost.
  std::size_t carry(std::span<const std::byte> sent, std::span<std::byte> received) noexcept;

  // The line is idle from now on: the character that was under way.
  std::optional<std::byte> idle() noexcept;

 private:
  UartSettings sender_;
  unsigned receiver_baud_ = 0;
  std::int64_t next_ = 0;  // sample, or look for an edge, after the end of what was sent, in 1/(2 sender receiver) s
  unsigned bit_ = 0;       // of the character under way that is sampled next, the start bit being 1; 0: none is
  unsigned data_ = 0;      // sampled so far
};

}  // namespace imud
