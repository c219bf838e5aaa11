// FrameCheck: the check of a frame, such as a CRC, a sum or an exclusive or.
//
// | name                     | the check is                                                                     |
// |--------------------------|----------------------------------------------------------------------------------|
// | crc16/xmodem, ...        | a CRC of the catalogue (protocols/wire/crc.hpp), or one that the file describes  |
// | sum8, sum16, sum32, ...  | the sum of the bytes in 8 to 64 bits                                             |
// | sum16/16, sum32/16, ...  | the sum of words of 16 (or 8, 32, 64) bits in the byte order of the check        |
// | xor8, xor16, ...         | the exclusive or of bytes, or of words that are as wide                          |
// | fletcher8                | two bytes: the sum of the bytes, and the sum of these sums, as in UBX           |
// | -sum8, ~sum8, -sum16/16  | its negative in two's complement, or its complement; also for xor                |
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "protocols/frames/layout/frame_description.hpp"

namespace imud {

class FrameCheck {
 public:
  // Returns the check named `name`; nullopt if no check has the name. `own`: the CRCs that the file describes.
  static std::optional<FrameCheck> find(std::string_view name, std::span<const FrameDescription::Check> own);
  // Returns the names of all checks, for suggestions.
  static std::vector<std::string> names(std::span<const FrameDescription::Check> own);

  std::size_t size() const noexcept { return size_; }            // bytes, 1 to 8
  std::size_t word_size() const noexcept { return word_size_; }  // bytes; the ranges have whole words

  // Returns the check of the bytes in `ranges` of `frame`, [begin, end), one range after another, followed by
  // `extra`. The lowest size() bytes of the result are sent in the byte order of the check; the first sum of
  // Fletcher's check is the first byte in either order. `is_big`: the byte order of words. Nothing is allocated.
  using Range = std::pair<std::size_t, std::size_t>;
  std::uint64_t of(std::span<const std::byte> frame, std::span<const Range> ranges, std::span<const std::byte> extra,
                   bool is_big) const noexcept;

 private:
  enum class Kind : std::uint8_t { crc, sum, exclusive_or, fletcher };
  enum class Sign : std::uint8_t { plain, negative, complement };

  Kind kind_ = Kind::sum;
  Sign sign_ = Sign::plain;
  std::size_t size_ = 1;
  std::size_t word_size_ = 1;
  std::optional<Crc> crc_;
};

}  // namespace imud
