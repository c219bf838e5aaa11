// append_little: appends the bytes of numbers to a text, the least significant first.
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

template <typename... Numbers>
void append_little(std::string& out, Numbers... numbers) {
  static_assert((std::is_arithmetic_v<Numbers> && ...));
  const auto append = [&out](auto number) {
    const auto bytes = std::bit_cast<std::array<char, sizeof number>>(number);
    append_little(out, bytes.data(), bytes.size());
  };
  (append(numbers), ...);
}

}  // namespace imud
