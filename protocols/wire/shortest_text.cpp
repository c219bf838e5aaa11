#include "protocols/wire/shortest_text.hpp"

#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <cstdlib>

namespace imud {

char* write_shortest(char* at, double number) noexcept {
  // An integer above this may have other digits than zeros behind its shortest ones.
  constexpr int exact_digits = 15;
  const double magnitude = std::abs(number);
  if (!(magnitude > 0) || !std::isfinite(magnitude)) return std::to_chars(at, at + longest_shortest_text, number).ptr;
  const auto [significand, exponent] = fmt::detail::dragonbox::to_decimal(magnitude);
  const int count = fmt::detail::count_digits(significand);
  const int before_point = count + exponent;  // digits; not positive: zeros follow the point
  if (before_point > exact_digits && exponent >= 0) return std::to_chars(at, at + longest_shortest_text, number).ptr;

  if (std::signbit(number)) *at++ = '-';
  const int power = before_point - 1;
  const int scientific = count + (count > 1 ? 1 : 0) + (std::abs(power) < 100 ? 4 : 5);
  const int fixed = exponent >= 0 ? before_point : before_point > 0 ? count + 1 : count + 2 - before_point;
  const bool is_fixed = fixed <= scientific;
  if (is_fixed && before_point <= 0) {
    *at++ = '0';
    *at++ = '.';
    for (int i = before_point; i < 0; ++i) *at++ = '0';
    return fmt::detail::format_decimal<char>(at, significand, count).end;
  }
  if (is_fixed && exponent >= 0) {
    at = fmt::detail::format_decimal<char>(at, significand, count).end;
    for (int i = 0; i < exponent; ++i) *at++ = '0';
    return at;
  }
  // The digits before the point move to the left, and the point takes the place of the last of them.
  char* const end = fmt::detail::format_decimal<char>(at + 1, significand, count).end;
  for (int i = is_fixed ? before_point : 1; i > 0; --i, ++at) at[0] = at[1];
  *at = '.';
  if (is_fixed) return end;
  at = count > 1 ? end : at;
  *at++ = 'e';
  *at++ = power < 0 ? '-' : '+';
  if (std::abs(power) < 10) *at++ = '0';
  return std::to_chars(at, at + 3, std::abs(power)).ptr;
}

}  // namespace imud
