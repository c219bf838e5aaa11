// UartWire: computes the input of a UART if characters are sent at another speed than its own.
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

// The wire is a waveform: idle 1, start bit 0, data bits, least significant first, parity, stop bits 1. The receiver
// waits for a falling edge and samples the middle of each bit at its own speed; a start bit that is not 0 in its
// middle is noise. A character without a stop bit is received as sampled, a break as 0, and parity is not checked:
// so does a tty whose client has not set INPCK (termios(3); n_tty_receive_parity_error() in Linux' n_tty.c).
class UartWire {
 public:
  // The most characters received for one sent, which is the most falling edges that one has.
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
  // When to sample, or from when to expect an edge, after the end of the last call, in s/(2 * sender * receiver
  // baud).
  std::int64_t next_ = 0;
  unsigned bit_ = 0;   // next bit to sample, the start bit being 1; 0: no character is being received
  unsigned data_ = 0;  // data bits sampled so far
};

}  // namespace imud
