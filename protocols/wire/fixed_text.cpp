#include "protocols/wire/fixed_text.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <system_error>

namespace imud {
namespace {

constexpr int most_fixed_decimals = 9;
constexpr std::array<std::uint32_t, most_fixed_decimals + 1> decimal_steps = {
    1, 10, 100, 1'000, 10'000, 100'000, 1'000'000, 10'000'000, 100'000'000, 1'000'000'000};

}  // namespace

std::to_chars_result write_fixed(char* at, char* end, double number, int decimals) noexcept {
  const bool is_in_range = number > -1e9 && number < 1e9 && decimals >= 0 && decimals <= most_fixed_decimals;
  if (!is_in_range) return std::to_chars(at, end, number, std::chars_format::fixed, decimals);
  // |number| = significand 2^-places, exactly.
  constexpr std::uint64_t hidden_bit = std::uint64_t{1} << 52;
  const auto bits = std::bit_cast<std::uint64_t>(number);
  const auto exponent = static_cast<int>(bits >> 52 & 0x7FFU);
  const std::uint64_t significand = (bits & (hidden_bit - 1)) | (exponent != 0 ? hidden_bit : 0);
  const int places = 1075 - std::max(exponent, 1);  // at least 23, because |number| is below 2^30
  // In units of the last decimal, the number is the sum of an integer and a rest, both exact.
  __extension__ using Wide = unsigned __int128;  // the product is below 2^83
  const Wide product = Wide{significand} * decimal_steps[static_cast<std::size_t>(decimals)];
  std::uint64_t whole = 0;
  if (places < 100) {  // otherwise the number is nearly 0
    whole = static_cast<std::uint64_t>(product >> places);
    const Wide rest = product - (Wide{whole} << places), half = Wide{1} << (places - 1);
    whole += rest > half || (rest == half && whole % 2 == 1) ? 1 : 0;  // a half goes to the even neighbour
  }
  std::array<char, 24> text;
  char* const last = text.data() + text.size();
  char* first = last;
  for (int i = 0; i < decimals; ++i, whole /= 10) *--first = static_cast<char>('0' + whole % 10);
  if (decimals > 0) *--first = '.';
  do {
    *--first = static_cast<char>('0' + whole % 10);
    whole /= 10;
  } while (whole > 0);
  if (bits >> 63 != 0) *--first = '-';
  if (end - at < last - first) return {end, std::errc::value_too_large};
  return {std::copy(first, last, at), std::errc()};
}

}  // namespace imud
