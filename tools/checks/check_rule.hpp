// CheckRule: a family of checks, recognised by the differences of frames.
//
// All checks here are linear: CRCs and exclusive or over GF(2), sums and Fletcher's over the integers. The difference
// of two frames' checks is therefore the check of the difference of their bytes with initial value and final XOR 0,
// and bytes that are the same in both frames do not count (Cook, CRC RevEng).
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "protocols/frames/layout/frame_check.hpp"
#include "protocols/wire/crc.hpp"

namespace imud {

struct CheckRule {
  enum class Kind : std::uint8_t { crc, sum, exclusive_or, fletcher };
  Kind kind = Kind::sum;
  std::size_t size = 1;           // bytes of the check
  std::size_t word_size = 1;      // bytes
  bool is_negative = false;       // the negative, or the complement
  std::size_t zeros = 0;          // bytes of 0 that follow the range: of a CRC
  bool is_extra_known = true;     // false: the extra bytes are one unknown byte, the same in each frame
  CrcParameters parameters = {};  // of a CRC; initial value and final XOR 0
  std::optional<Crc> crc = {};
  std::vector<std::string> names = {};  // of the checks of the family, for FrameCheck
};

// Returns the families of all CRCs of the catalogue, sums, exclusive or, Fletcher's.
std::vector<CheckRule> check_rules();
// Returns the family of a CRC without a name.
CheckRule crc_rule(const CrcParameters& parameters);

// The check of the difference of two frames, byte by byte.
class CheckDifference {
 public:
  // `is_big`: the byte order of words. `rule` must outlive this.
  CheckDifference(const CheckRule& rule, bool is_big) : rule_(rule), is_big_(is_big) {}

  void add(std::byte one, std::byte other) noexcept;
  // Returns true if the bytes added so far are whole words.
  bool is_whole() const noexcept { return in_word_ == 0; }
  // Returns true if the checks that stand at `at` in both frames have the computed difference. `is_big`: the byte
  // order of the checks.
  bool agrees(std::span<const std::byte> one, std::span<const std::byte> other, std::size_t at,
              bool is_big) const noexcept;

 private:
  const CheckRule& rule_;
  bool is_big_;
  std::uint64_t sum_ = 0, second_ = 0, word_ = 0, other_word_ = 0;
  std::size_t in_word_ = 0;
};

// Returns true if `rule` with these ranges, [begin, end), explains the difference of the checks at `at`.
bool agrees(const CheckRule& rule, std::span<const FrameCheck::Range> ranges, std::size_t at, bool is_big,
            std::span<const std::byte> one, std::span<const std::byte> other) noexcept;

// Returns the number in `size` bytes.
std::uint64_t number_at(std::span<const std::byte> bytes, std::size_t at, std::size_t size, bool is_big) noexcept;
// Returns the float in 4 or 8 bytes.
double float_at(std::span<const std::byte> bytes, std::size_t at, std::size_t size, bool is_big) noexcept;

}  // namespace imud
