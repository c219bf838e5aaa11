// Wire layouts as structs: a layout is a struct of bytes and Boost.Endian buffers (alignment 1, no padding), which
// encoder and decoder share, so that the struct is the table of the document.
#pragma once

#include <algorithm>
#include <boost/endian/buffers.hpp>
#include <cfloat>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <type_traits>

#include "core/vector.hpp"

namespace imud {

template <class T>
concept WireLayout = std::is_trivially_copyable_v<T> && std::is_standard_layout_v<T> && alignof(T) == 1;

// read_wire() and write_wire() require at least sizeof(T) elements in `bytes`.
template <WireLayout T>
T read_wire(std::span<const std::byte> bytes) noexcept {
  T wire;
  std::memcpy(&wire, bytes.data(), sizeof(T));
  return wire;
}

template <WireLayout T>
void write_wire(const T& wire, std::span<std::byte> bytes) noexcept {
  std::memcpy(bytes.data(), &wire, sizeof(T));
}

// Read and write a little-endian number of bytes.size() bytes. Both require at most 8 bytes.
inline std::uint64_t read_little(std::span<const std::byte> bytes) noexcept {
  std::uint64_t number = 0;
  for (std::size_t i = bytes.size(); i > 0; --i) number = number << 8 | std::to_integer<std::uint64_t>(bytes[i - 1]);
  return number;
}
inline void write_little(std::uint64_t number, std::span<std::byte> bytes) noexcept {
  for (std::byte& byte : bytes) {
    byte = static_cast<std::byte>(number);
    number >>= 8;
  }
}

// Returns the nearest float; saturates at FLT_MAX.
inline float to_float(double value) noexcept {
  return static_cast<float>(std::clamp(value, -double{FLT_MAX}, double{FLT_MAX}));
}

// Returns the nearest integer; halves are rounded away from zero. Same result as std::llround(), which takes ten
// times the instructions. Requires a result within the range of std::int64_t.
constexpr std::int64_t to_integer(double value) noexcept {
  const auto whole = static_cast<std::int64_t>(value);
  const double rest = value - static_cast<double>(whole);  // exact
  return whole + (rest >= 0.5) - (rest <= -0.5);
}
// Returns the bits of the same integer, in two's complement. `value`: in [-2^63, 2^64).
constexpr std::uint64_t to_integer_bits(double value) noexcept {
  return value >= 0x1p63 ? static_cast<std::uint64_t>(value) : static_cast<std::uint64_t>(to_integer(value));
}

// Writes x, y, z in this order. `Buffer` is a floating-point Boost.Endian buffer; a 32-bit one saturates at FLT_MAX.
template <class Buffer>
void put_vector(const Vector3& vector, Buffer (&wire)[3]) noexcept {
  for (int i = 0; i < 3; ++i) {
    if constexpr (sizeof(Buffer) == sizeof(float)) {
      wire[i] = to_float(vector[i]);
    } else {
      wire[i] = vector[i];
    }
  }
}

template <class Buffer>
Vector3 get_vector(const Buffer (&wire)[3]) noexcept {
  return {wire[0].value(), wire[1].value(), wire[2].value()};
}

}  // namespace imud
