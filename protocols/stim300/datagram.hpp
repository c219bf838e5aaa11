// Datagrams of the STIM300: the declarations shared by encoder and decoder.
#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include "core/frame.hpp"
#include "protocols/protocol.hpp"
#include "protocols/stim300/stim300.hpp"
#include "protocols/wire/frame_writer.hpp"

namespace imud::stim300 {

inline constexpr std::size_t longest_datagram = 65;

// Returns the identifier of a Normal Mode datagram (Table 5-21; for AUX, from earlier revisions: a capture
// of a real unit has 0xAF).
constexpr unsigned identifier(unsigned content, bool has_aux) noexcept {
  if (content > 7 && !has_aux) return 0xF0 + (content & 7U);
  return ((content & 7U) > 4 ? 0xA0 : 0x90) + content;
}
static_assert(identifier(0b0111, false) == 0xA7 && identifier(0b1111, true) == 0xAF &&
              identifier(0b1100, true) == 0x9C);

// Returns the CRC-32 of a datagram's fields, padded with zeros to a multiple of 4 bytes (section 5.5.7).
std::uint32_t crc_of(std::span<const std::byte> bytes) noexcept;

// Returns the size in bytes, without CR LF, of a datagram with this identifier; 0 if no datagram has it.
std::size_t datagram_size_of(unsigned id) noexcept;
// FrameSeal::reseal().
std::span<std::byte> reseal(std::span<std::byte> datagram, const CanHeader&) noexcept;

// Writes one datagram into a FrameBuffer.
class Datagram {
 public:
  explicit Datagram(FrameBuffer& out) noexcept : frame_(out, longest_datagram) {}
  void put(std::uint64_t number, unsigned bytes) noexcept { frame_.put_low_bytes(number, bytes); }
  void put_number(double number, unsigned bytes) noexcept { frame_.put_rounded(number, bytes); }
  void put_halves(unsigned high, unsigned low) noexcept { put(high << 4 | low, 1); }
  // Appends the CRC, and CR LF if `cr_lf`; completes the frame. Returns the number of characters of the datagram.
  std::size_t finish(bool cr_lf) noexcept {
    put(crc_of(frame_.written()), 4);
    if (cr_lf) put(0x0D0A, 2);
    frame_.push();
    return frame_.size();
  }

 private:
  FrameWriter<boost::endian::order::big> frame_;
};

// The special datagrams, each as a bit of a set, in the order in which Init Mode sends them (section 7.5.1).
enum Special : unsigned { of_part = 1, of_serial = 2, of_configuration = 4, of_trim = 8, of_errors = 16 };
// Writes a special datagram and returns its number of characters. The datagram of_errors clears the errors.
std::size_t write_special(Special special, Memory& memory, FrameBuffer& out) noexcept;

// Writes a Normal Mode datagram and returns its number of characters.
std::size_t write_measurement(const std::array<Axes, 3>& axes, const Reading& reading, Memory& memory,
                              FrameBuffer& out) noexcept;

// Returns a decoder of all datagrams. The decoder uses the units and the range of `configuration` until it receives a
// configuration datagram. No other datagram states units and range.
std::unique_ptr<Decoder> make_decoder(const Configuration& configuration);

}  // namespace imud::stim300
