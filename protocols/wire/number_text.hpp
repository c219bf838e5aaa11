// Parses numbers in the text that hosts send.
#pragma once

#include <charconv>
#include <concepts>
#include <optional>
#include <string_view>

namespace imud {

// Parses the whole of `text`, in which neither a plus nor blanks are allowed. Returns nullopt if it is not a number,
// or out of the type's range. `radix` applies to integers.
template <class Number>
std::optional<Number> number_in(std::string_view text, int radix = 10) noexcept {
  Number number{};
  const char* const end = text.data() + text.size();
  std::from_chars_result result{};
  if constexpr (std::integral<Number>)
    result = std::from_chars(text.data(), end, number, radix);
  else
    result = std::from_chars(text.data(), end, number);
  if (result.ec != std::errc() || result.ptr != end) return std::nullopt;
  return number;
}
// The same for an integer, which has hexadecimal digits after "0x" or "0X".
template <class Number>
std::optional<Number> number_or_hex_in(std::string_view text) noexcept {
  const bool is_hexadecimal = text.starts_with("0x") || text.starts_with("0X");
  return number_in<Number>(text.substr(is_hexadecimal ? 2 : 0), is_hexadecimal ? 16 : 10);
}

}  // namespace imud
