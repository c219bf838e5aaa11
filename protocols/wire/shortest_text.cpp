#include "protocols/wire/shortest_text.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <boost/endian/conversion.hpp>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <cstring>

#if defined(__SSE2__)
#include <emmintrin.h>
#endif

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

#if defined(__SSE2__)
// Writes the sixteen digits of two numbers below 10^8. Their parts are in lanes of one register: two of four digits
// in each half, then four of two, then eight of one; the first digits are in the lowest lane. A division by 10^4, 100
// or 10 is a multiplication and a shift, which are exact for numbers below 10^8, 10^4 and 10^2.
void write_sixteen(char* at, std::uint64_t first, std::uint64_t second) noexcept {
  const __m128i eights = _mm_set_epi64x(static_cast<std::int64_t>(second), static_cast<std::int64_t>(first));
  const __m128i upper = _mm_srli_epi64(_mm_mul_epu32(eights, _mm_set1_epi64x(0xD1B7'1759)), 45);
  const __m128i lower = _mm_sub_epi64(eights, _mm_mul_epu32(upper, _mm_set1_epi64x(10'000)));
  const __m128i fours = _mm_or_si128(upper, _mm_slli_epi64(lower, 32));
  const __m128i hundreds = _mm_srli_epi16(_mm_mulhi_epu16(fours, _mm_set1_epi16(5243)), 3);
  const __m128i below_100 = _mm_sub_epi16(fours, _mm_mullo_epi16(hundreds, _mm_set1_epi16(100)));
  const __m128i twos = _mm_or_si128(hundreds, _mm_slli_epi32(below_100, 16));
  const __m128i tens = _mm_mulhi_epu16(twos, _mm_set1_epi16(6554));
  const __m128i below_10 = _mm_sub_epi16(twos, _mm_mullo_epi16(tens, _mm_set1_epi16(10)));
  const __m128i ones = _mm_or_si128(tens, _mm_slli_epi16(below_10, 8));
  _mm_storeu_si128(reinterpret_cast<__m128i*>(at), _mm_add_epi8(ones, _mm_set1_epi8('0')));
}
#else
// Does the same for one number, whose parts are in lanes of one word.
void write_eight(char* at, std::uint64_t number) noexcept {
  const std::uint64_t fours = number / 10'000 | number % 10'000 << 32U;
  const std::uint64_t hundreds = fours * 5243 >> 19U & 0x0000'007F'0000'007F;
  const std::uint64_t twos = hundreds | (fours - 100 * hundreds) << 16U;
  const std::uint64_t tens = twos * 103 >> 10U & 0x000F'000F'000F'000F;
  const std::uint64_t ones = tens | (twos - 10 * tens) << 8U;
  boost::endian::store_little_u64(reinterpret_cast<unsigned char*>(at), ones + 0x3030'3030'3030'3030);
}

void write_sixteen(char* at, std::uint64_t first, std::uint64_t second) noexcept {
  write_eight(at, first);
  write_eight(at + 8, second);
}
#endif

// Writes the `count` digits of `number`, and zeros behind them, all_digits characters in total. Returns the end of
// the digits.
[[gnu::always_inline]] inline char* write_digits(char* at, std::uint64_t number, int count) noexcept {
  constexpr std::uint64_t eight = 100'000'000;
  const std::uint64_t padded = number * powers_of_ten[static_cast<std::size_t>(all_digits - count)];
  const std::uint64_t nine = padded / eight;
  *at = static_cast<char>('0' + nine / eight);
  write_sixteen(at + 1, nine % eight, padded % eight);
  return at + count;
}

// Moves the first `count` of the digits behind `at` to the left, and puts the point between them and the others.
// Returns the place of the point.
[[gnu::always_inline]] inline char* set_point(char* at, int count) noexcept {
  for (int i = count; i > 0; --i, ++at) at[0] = at[1];
  *at = '.';
  return at;
}

// The next two are out of line, so that write() saves none of the registers that they need.
[[gnu::noinline]] char* write_scientific(char* at, std::uint64_t significand, int count, int power) noexcept {
  char* const end = write_digits(at + 1, significand, count);
  char* const point = set_point(at, 1);
  at = count > 1 ? end : point;
  *at++ = 'e';
  *at++ = power < 0 ? '-' : '+';
  if (std::abs(power) < 10) *at++ = '0';
  return std::to_chars(at, at + 3, std::abs(power)).ptr;
}

[[gnu::noinline]] char* write_integer(char* at, std::uint64_t significand, int count, int zeros) noexcept {
  return std::fill_n(write_digits(at, significand, count), zeros, '0');
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
  if (fixed > scientific) return write_scientific(at, significand, count, power);
  if (exponent >= 0) return write_integer(at, significand, count, exponent);
  if (before_point <= 0) {
    std::memcpy(at, "0.000", 5);  // with more zeros behind the point, the scientific text would be shorter
    return write_digits(at + 2 - before_point, significand, count);
  }
  char* const end = write_digits(at + 1, significand, count);
  set_point(at, before_point);
  return end;
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
