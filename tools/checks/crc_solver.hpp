// crc_solver: the parameters of an unknown CRC, from frames (Cook, CRC RevEng).
//
// With the difference of two frames of equal length as a polynomial D, and the difference of their CRCs as C, the
// generator divides D x^width + C: it is the greatest common divisor of this polynomial over several pairs of
// frames. The initial value follows from a whole frame. Frames of one length alone do not distinguish the initial
// value from the final XOR; frames of two lengths do.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "protocols/frames/layout/frame_check.hpp"
#include "protocols/wire/crc.hpp"

namespace imud {

// The place of a CRC in frames of equal length.
struct CrcPlace {
  FrameCheck::Range range;  // of its bytes, [begin, end)
  std::size_t at = 0;       // of the CRC
  std::size_t size = 1;     // bytes, 1 to 8
  bool is_big = false;      // high byte first
};

// Returns the polynomial of a CRC whose input and output are reflected or not, and with initial value and final
// XOR 0; nullopt if the frames have no common polynomial. Some damaged frames do no harm. Requires at least 16
// frames.
std::optional<CrcParameters> find_polynomial(std::span<const std::span<const std::byte>> frames,
                                             const CrcPlace& place, bool refin, bool refout);

// Returns the initial value with which `bytes`, followed by `zeros` bytes of 0, have this CRC. Requires an odd
// polynomial.
std::uint64_t initial_value(const CrcParameters& parameters, std::span<const std::byte> bytes, std::size_t zeros,
                            std::uint64_t crc);

// A message and its CRC.
struct CrcExample {
  std::span<const std::byte> bytes;
  std::uint64_t crc = 0;
};
// Returns the parameters with an initial value and a final XOR that give both CRCs; nullopt if there are none. If
// the lengths differ little, or if x + 1 divides the generator, several parameters give both CRCs; then returns
// one of these solutions.
std::optional<CrcParameters> solve_initial(const CrcParameters& parameters, const CrcExample& one,
                                           const CrcExample& other);

}  // namespace imud
