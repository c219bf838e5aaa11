// append_little: appends a number's bytes to a text, the least significant first.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <string>
#include <type_traits>

namespace imud {

// Appends a number's bytes as they are in memory, turned round where the processor is big-endian.
inline void append_little(std::string& out, const char* bytes, std::size_t size) {
  out.append(bytes, size);
  if constexpr (std::endian::native == std::endian::big)
    std::reverse(out.end() - static_cast<std::ptrdiff_t>(size), out.end());
}

template <typename T>
void append_little(std::string& out, T value) {
  static_assert(std::is_arithmetic_v<T>);
  const auto bytes = std::bit_cast<std::array<char, sizeof(T)>>(value);
  append_little(out, bytes.data(), bytes.size());
}

}  // namespace imud
