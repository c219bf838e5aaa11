// UartWire: computes the characters that a UART receives if the sender has another speed.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "core/uart.hpp"

namespace imud {

// Returns whether two UARTs receive one another's characters: until the middle of the stop bit, the slower one falls
// behind by less than half a bit. Speeds in bit/s.
constexpr bool speeds_match(unsigned baud, unsigned other, const UartSettings& characters) noexcept {
  const std::uint64_t bits = 10 + (characters.parity == Parity::none ? 0 : 1);  // to the end of the first stop bit
  const std::uint64_t fast = baud > other ? baud : other, slow = baud > other ? other : baud;
  return (2 * bits - 1) * fast < 2 * bits * slow;
}

// The wire is a waveform: idle 1, start bit 0, data bits, least significant first, parity, stop bits 1. The
// receiver waits for a falling edge and samples the middle of each bit at its own speed; a start bit that is not 0
// in its middle is noise. A character without a stop bit is received as sampled, a break is received as 0, and
// parity is not checked. A tty whose client has not set INPCK does the same (termios(3);
// n_tty_receive_parity_error() in Linux' n_tty.c).
class UartWire {
 public:
  // The greatest number of characters received for one character sent: a character has at most so many falling
  // edges.
  static constexpr std::size_t max_received = 5;

  // `sender.baud` and `receiver_baud` are from 50 to 4'000'000 bit/s. A change discards the character that is being
  // received.
  void set(const UartSettings& sender, unsigned receiver_baud) noexcept;

  // Sends characters back to back, directly after the last call's characters. Writes the characters received by the
  // end of the sending to `received` and returns their number. Characters without room are lost.
  std::size_t carry(std::span<const std::byte> sent, std::span<std::byte> received) noexcept;

  // Makes the line idle from now on. Returns the character that was being received; nullopt if there was none.
  std::optional<std::byte> idle() noexcept;

 private:
  UartSettings sender_;
  unsigned receiver_baud_ = 0;
  // The time of the next sample, or the time from which an edge is expected, since the end of the last call. The
  // unit is s/(2 * sender baud * receiver baud).
  std::int64_t next_ = 0;
  unsigned bit_ = 0;   // next bit to sample, the start bit being 1; 0: no character is being received
  unsigned data_ = 0;  // data bits sampled so far
};

}  // namespace imud
