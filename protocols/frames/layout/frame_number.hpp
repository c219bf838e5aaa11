// FrameNumber: the type and byte order of a number in a frame.
#pragma once

#include <boost/endian/conversion.hpp>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string>

#include "protocols/wire/bits.hpp"

namespace imud {

// A number of a frame: u8 to u64, i8 to i64 in whole bytes, f32, f64.
struct FrameNumber {
  enum class Format : std::uint8_t { unsigned_integer, signed_integer, float32, float64 };
  Format format = Format::unsigned_integer;
  std::size_t bytes = 1;  // 1 to 8
  bool is_big = false;    // high byte first
  bool is_float() const noexcept { return format == Format::float32 || format == Format::float64; }
  // Returns the type as in "u8", "i16 le" or "f32 be".
  std::string text() const {
    const char* const order = bytes == 1 ? "" : is_big ? " be" : " le";
    return (is_float() ? "f" : format == Format::signed_integer ? "i" : "u") + std::to_string(8 * bytes) + order;
  }
};

// store_number() writes the lowest `type.bytes` bytes of `bits`; load_number() reads so many bytes.
inline void store_number(std::uint64_t bits, const FrameNumber& type, std::byte* to) noexcept {
  const std::uint64_t ordered = type.is_big ? boost::endian::native_to_big(bits << (64 - 8 * type.bytes))
                                            : boost::endian::native_to_little(bits);
  switch (type.bytes) {  // The compiler makes one instruction of a copy whose size it knows.
    case 1:
      std::memcpy(to, &ordered, 1);
      break;
    case 2:
      std::memcpy(to, &ordered, 2);
      break;
    case 4:
      std::memcpy(to, &ordered, 4);
      break;
    case 8:
      std::memcpy(to, &ordered, 8);
      break;
    default:
      std::memcpy(to, &ordered, type.bytes);
  }
}

inline std::uint64_t load_number(const FrameNumber& type, const std::byte* from) noexcept {
  std::uint64_t ordered = 0;
  std::memcpy(&ordered, from, type.bytes);
  return type.is_big ? boost::endian::big_to_native(ordered) >> (64 - 8 * type.bytes)
                     : boost::endian::little_to_native(ordered);
}

}  // namespace imud
