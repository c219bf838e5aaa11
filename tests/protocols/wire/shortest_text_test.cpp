#include "protocols/wire/shortest_text.hpp"

#include <gtest/gtest.h>

#include <array>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <limits>
#include <random>
#include <string>
#include <string_view>
#include <utility>

namespace imud {
namespace {

std::string shortest(double number) {
  std::array<char, longest_shortest_text> text;
  return {text.data(), write_shortest(text.data(), number)};
}

std::string by_to_chars(double number) {
  std::array<char, 32> text;
  return {text.data(), std::to_chars(text.data(), text.data() + text.size(), number).ptr};
}

TEST(ShortestTextTest, WritesTheCharactersOfToChars) {
  using Limits = std::numeric_limits<double>;
  for (const double number : {0.0,
                              -0.0,
                              1.0,
                              -1.0,
                              25.0,
                              1e5,
                              1e6,
                              123456.0,
                              1e15,
                              1e16,
                              1e22,
                              1e23,
                              9007199254740993.0,
                              1e-3,
                              1e-4,
                              1.5e-4,
                              1e-5,
                              12e-5,
                              1e-9,
                              1e-99,
                              1e-100,
                              0.1,
                              0.3,
                              1.0 / 3.0,
                              9.80665,
                              5e-324,
                              Limits::min(),
                              Limits::max(),
                              Limits::epsilon(),
                              Limits::infinity(),
                              -Limits::infinity(),
                              299792458.0,
                              1.25e-7,
                              7.2921151467e-5})
    EXPECT_EQ(shortest(number), by_to_chars(number));
}

// Every exponent, few and many digits, and the magnitudes of samples.
TEST(ShortestTextTest, WritesTheCharactersOfToCharsForRandomNumbers) {
  std::mt19937_64 random(1);
  std::uniform_int_distribution<int> exponent(-24, 24), digits(0, 17);
  std::normal_distribution<double> normal;
  int compared = 0;
  for (int i = 0; i < 200'000; ++i) {
    const auto any = std::bit_cast<double>(random());
    const double few = std::round(normal(random) * std::pow(10.0, digits(random))) * std::pow(10.0, exponent(random));
    for (const double number : {any, few, normal(random), 1e-4 * normal(random), 1e7 * normal(random)}) {
      if (std::isnan(number)) continue;
      ++compared;
      ASSERT_EQ(shortest(number), by_to_chars(number));
    }
  }
  EXPECT_GT(compared, 990'000);
}

// The significant digits of a decimal text, without zeros around them, and the power of ten of the first.
std::pair<std::string, int> digits_of(std::string_view text) {
  std::string digits;
  int power = -1, exponent = 0;
  bool after_point = false;
  if (text.starts_with('-')) text.remove_prefix(1);
  for (; !text.empty() && text[0] != 'e'; text.remove_prefix(1)) {
    if (text[0] == '.') {
      after_point = true;
      continue;
    }
    if (!digits.empty() || text[0] != '0') digits += text[0];
    if (digits.empty())
      power -= after_point ? 1 : 0;
    else
      power += after_point ? 0 : 1;
  }
  if (!text.empty()) exponent = std::stoi(std::string(text.substr(1)));
  while (digits.ends_with('0')) digits.pop_back();
  return {digits, power + exponent};
}

std::string text_of(double number, int digits) {
  std::array<char, longest_shortest_text> text;
  return {text.data(), write_rounded(text.data(), number, digits)};
}

// By printf, whose digits are the exact value's. Half of the numbers are halfway between two results, or just beside.
TEST(ShortestTextTest, RoundsTheExactValueToFewerDigits) {
  std::mt19937_64 random(2);
  std::uniform_int_distribution<int> digits(1, all_digits - 1), exponent(-30, 30), places(0, 40);
  std::normal_distribution<double> normal;
  int ties = 0;
  for (int i = 0; i < 100'000; ++i) {
    const int n = digits(random);
    const double short_one = std::round(normal(random) * std::pow(10.0, n)) + 0.5;
    const double dyadic = std::ldexp(static_cast<double>(2 * (random() % 500'000) + 1), -places(random));
    for (const double number : {normal(random), normal(random) * std::pow(10.0, exponent(random)),
                                short_one * std::pow(10.0, exponent(random)), short_one / 8, dyadic}) {
      std::array<char, 64> rounded, scientific;
      std::snprintf(rounded.data(), rounded.size(), "%.*e", n - 1, number);
      *std::to_chars(scientific.begin(), scientific.end(), number, std::chars_format::scientific).ptr = '\0';
      const auto all = digits_of(scientific.data());
      const std::string text = text_of(number, n);
      const bool is_rounded = all.first.size() > static_cast<std::size_t>(n);
      ASSERT_EQ(digits_of(text), is_rounded ? digits_of(rounded.data()) : all) << text << ' ' << rounded.data();
      ASSERT_EQ(text.starts_with('-'), std::signbit(number));
      ties += all.first.size() == static_cast<std::size_t>(n) + 1 && all.first.ends_with('5') ? 1 : 0;
    }
  }
  EXPECT_GT(ties, 1000);
}

TEST(ShortestTextTest, FewerDigitsAreAsShortAsPossible) {
  EXPECT_EQ(text_of(1.0 / 3, 6), "0.333333");
  EXPECT_EQ(text_of(-2.0 / 3, 6), "-0.666667");
  EXPECT_EQ(text_of(0.1, 6), "0.1");
  EXPECT_EQ(text_of(0.99999999, 6), "1");
  EXPECT_EQ(text_of(9.80665, 3), "9.81");
  EXPECT_EQ(text_of(123456789, 3), "1.23e+08");
  EXPECT_EQ(text_of(1234567890123456789.0, 17), shortest(1234567890123456789.0));
  EXPECT_EQ(text_of(1e22, 3), "1e+22");
  EXPECT_EQ(text_of(2.5, 1), "2");     // halfway: to even
  EXPECT_EQ(text_of(0.15, 1), "0.1");  // the double is below the text
  EXPECT_EQ(text_of(0.35, 1), "0.3");
  EXPECT_EQ(text_of(0.45, 1), "0.5");
  EXPECT_EQ(text_of(-0.0, 1), "-0");
}

}  // namespace
}  // namespace imud
