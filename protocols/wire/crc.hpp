// Crc: computes a CRC from its parameters. find_crc(): finds an algorithm of the CRC catalogue by its name.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace imud {

// The parameters of the Rocksoft model. `poly`, `init` and `xorout` have no bit above `width`; they are as the
// catalogue writes them, not reflected.
struct CrcParameters {
  unsigned width = 8;  // bits: 8, 16, 24, 32, 40, 48, 56 or 64
  std::uint64_t poly = 0;
  std::uint64_t init = 0;
  bool refin = false;
  bool refout = false;
  std::uint64_t xorout = 0;
};

// An algorithm of the catalogue (reveng.sourceforge.io/crc-catalogue), whose width is a multiple of 8. `check` is the
// CRC of the text "123456789".
struct CrcAlgorithm {
  std::string_view name;  // "crc16/xmodem"
  CrcParameters parameters;
  std::uint64_t check = 0;
};

// Returns the algorithms, in the order of their widths.
std::span<const CrcAlgorithm> crc_algorithms() noexcept;
// Returns the algorithm of that name, which may be spelt "CRC-16/XMODEM" as well; nullptr if there is none.
const CrcAlgorithm* find_crc(std::string_view name) noexcept;

// Computes a CRC byte by byte with a table of 256 entries. Nothing throws or allocates.
class Crc {
 public:
  // The width must be one of CrcParameters.
  explicit Crc(const CrcParameters& parameters) noexcept;

  unsigned width() const noexcept { return parameters_.width; }  // bits
  // Returns the CRC of pieces of bytes: finish(update(... update(start(), first piece) ..., last piece)).
  std::uint64_t start() const noexcept { return start_; }
  std::uint64_t update(std::uint64_t state, std::span<const std::byte> bytes) const noexcept;
  std::uint64_t finish(std::uint64_t state) const noexcept;

 private:
  CrcParameters parameters_;
  std::uint64_t start_;
  std::array<std::uint64_t, 256> table_;
};

}  // namespace imud
