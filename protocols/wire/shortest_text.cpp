#include "protocols/wire/shortest_text.hpp"

#include <fmt/format.h>

#include <array>
#include <boost/endian/conversion.hpp>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <cstring>

namespace imud {
namespace {

struct Decimal {
  std::uint64_t significand;
  int exponent;
};

constexpr auto powers_of_ten = [] {
  std::array<std::uint64_t, all_digits + 1> powers{1};
  for (std::size_t i = 1; i < powers.size(); ++i) powers[i] = 10 * powers[i - 1];
  return powers;
}();

// Writes the eight digits of `number`, which must be below 10^8. The parts of the number are in lanes of one word:
// two of four digits, then four of two, then eight of one; the first digits are in the lowest lane. A division by 100
// or 10 is a multiplication and a shift, which are exact for numbers below 10^4 and 10^2.
void write_eight(char* at, std::uint32_t number) noexcept {
  const std::uint64_t fours = number / 10'000 | std::uint64_t{number % 10'000} << 32U;
  const std::uint64_t hundreds = fours * 5243 >> 19U & 0x0000'007F'0000'007F;
  const std::uint64_t twos = hundreds | (fours - 100 * hundreds) << 16U;
  const std::uint64_t tens = twos * 103 >> 10U & 0x000F'000F'000F'000F;
  const std::uint64_t ones = tens | (twos - 10 * tens) << 8U;
  boost::endian::store_little_u64(reinterpret_cast<unsigned char*>(at), ones + 0x3030'3030'3030'3030);
}

// Writes the `count` digits of `number`, and zeros behind them, all_digits characters in total. Returns the end of
// the digits.
char* write_digits(char* at, std::uint64_t number, int count) noexcept {
  constexpr std::uint64_t eight = 100'000'000;
  const std::uint64_t padded = number * powers_of_ten[static_cast<std::size_t>(all_digits - count)];
  const std::uint64_t nine = padded / eight;
  *at = static_cast<char>('0' + nine / eight);
  write_eight(at + 1, static_cast<std::uint32_t>(nine % eight));
  write_eight(at + 9, static_cast<std::uint32_t>(padded % eight));
  return at + count;
}

// Rounds the exact value of `magnitude` to `digits` significant digits.
Decimal rounded_exactly(double magnitude, int digits) noexcept {
  std::array<char, 32> text;
  const char* const end =
      std::to_chars(text.begin(), text.end(), magnitude, std::chars_format::scientific, digits - 1).ptr;
  Decimal decimal{0, 0};
  const char* at = text.begin();
  for (; *at != 'e'; ++at)
    if (*at != '.') decimal.significand = 10 * decimal.significand + static_cast<std::uint64_t>(*at - '0');
  std::from_chars(at[1] == '+' ? at + 2 : at + 1, end, decimal.exponent);
  decimal.exponent -= digits - 1;
  return decimal;
}

// Rounds the shortest digits of `magnitude`, of which there are `count`. The exact value rounds to the same digits,
// unless the shortest digits are halfway between two results. If another halfway number lay between the shortest
// digits and the exact value, that number would have fewer digits, and would itself be the shortest.
Decimal rounded(double magnitude, Decimal shortest, int count, int digits) noexcept {
  const std::uint64_t unit = powers_of_ten[static_cast<std::size_t>(count - digits)];
  const std::uint64_t rest = shortest.significand % unit;
  Decimal decimal{shortest.significand / unit + (rest > unit / 2 ? 1 : 0), shortest.exponent + count - digits};
  if (rest == unit / 2) decimal = rounded_exactly(magnitude, digits);
  for (; decimal.significand % 10 == 0; ++decimal.exponent) decimal.significand /= 10;
  return decimal;
}

// Compiled separately for both values of `is_limited`, so that numbers with all digits spend no time on the limit.
template <bool is_limited>
[[gnu::always_inline]] inline char* write(char* at, double number, [[maybe_unused]] int digits) noexcept {
  // An integer above this may have other digits than zeros behind its shortest ones.
  constexpr int exact_digits = 15;
  const double magnitude = std::abs(number);
  if (!(magnitude > 0) || !std::isfinite(magnitude)) return std::to_chars(at, at + longest_shortest_text, number).ptr;
  auto [significand, exponent] = fmt::detail::dragonbox::to_decimal(magnitude);
  int count = fmt::detail::count_digits(significand);
  if constexpr (is_limited) {
    if (count > digits) {
      const Decimal fewer = rounded(magnitude, {significand, exponent}, count, digits);
      significand = fewer.significand;
      exponent = fewer.exponent;
      count = fmt::detail::count_digits(significand);
    }
  }
  const int before_point = count + exponent;  // digits; not positive: zeros follow the point
  if (!is_limited && before_point > exact_digits && exponent >= 0)
    return std::to_chars(at, at + longest_shortest_text, number).ptr;

  if (std::signbit(number)) *at++ = '-';
  const int power = before_point - 1;
  const int scientific = count + (count > 1 ? 1 : 0) + (std::abs(power) < 100 ? 4 : 5);
  const int fixed = exponent >= 0 ? before_point : before_point > 0 ? count + 1 : count + 2 - before_point;
  const bool is_fixed = fixed <= scientific;
  if (is_fixed && before_point <= 0) {
    std::memcpy(at, "0.000", 5);  // with more zeros behind the point, the scientific text would be shorter
    return write_digits(at + 2 - before_point, significand, count);
  }
  if (is_fixed && exponent >= 0) {
    at = write_digits(at, significand, count);
    for (int i = 0; i < exponent; ++i) *at++ = '0';
    return at;
  }
  // The digits before the point move to the left, and the point takes the place of the last of them.
  char* const end = write_digits(at + 1, significand, count);
  for (int i = is_fixed ? before_point : 1; i > 0; --i, ++at) at[0] = at[1];
  *at = '.';
  if (is_fixed) return end;
  at = count > 1 ? end : at;
  *at++ = 'e';
  *at++ = power < 0 ? '-' : '+';
  if (std::abs(power) < 10) *at++ = '0';
  return std::to_chars(at, at + 3, std::abs(power)).ptr;
}

}  // namespace

char* write_shortest(char* at, double number) noexcept { return write<false>(at, number, all_digits); }

char* write_rounded(char* at, double number, int digits) noexcept {
  return digits < all_digits ? write<true>(at, number, digits) : write_shortest(at, number);
}

std::string shortest_text(double number) {
  char text[longest_shortest_text];
  return {text, write_shortest(text, number)};
}

}  // namespace imud
