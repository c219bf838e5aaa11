// Parses numbers in the text of hosts, users and files.
#pragma once

#include <charconv>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <optional>
#include <string_view>
#include <utility>

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
// Does the same as number_in<double>(), but returns nullopt for an infinity and for NaN, too.
inline std::optional<double> finite_number_in(std::string_view text) noexcept {
  const auto number = number_in<double>(text);
  return number && std::isfinite(*number) ? number : std::nullopt;
}
// Does the same as number_in() for an integer that is decimal, or hexadecimal after a prefix "0x" or "0X".
template <class Number>
std::optional<Number> number_or_hex_in(std::string_view text) noexcept {
  const bool is_hexadecimal = text.starts_with("0x") || text.starts_with("0X");
  return number_in<Number>(text.substr(is_hexadecimal ? 2 : 0), is_hexadecimal ? 16 : 10);
}
// Parses two integers separated by `between`, such as "1..7". Returns nullopt for any other text, or if the second
// integer is less than the first.
template <std::integral Number>
std::optional<std::pair<Number, Number>> range_in(std::string_view text, std::string_view between) noexcept {
  const std::size_t at = text.find(between);
  if (at == text.npos) return std::nullopt;
  const auto first = number_in<Number>(text.substr(0, at)),
             last = number_in<Number>(text.substr(at + between.size()));
  if (!first || !last || *last < *first) return std::nullopt;
  return std::pair(*first, *last);
}

}  // namespace imud
