#include "protocols/wire/fixed_text.hpp"

#include <gtest/gtest.h>

#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <random>
#include <string>
#include <string_view>

namespace imud {
namespace {

void expect_as_to_chars(double number, int decimals) {
  std::array<char, 400> expected, text;
  const char* const expected_end =
      std::to_chars(expected.begin(), expected.end(), number, std::chars_format::fixed, decimals).ptr;
  const auto [end, error] = write_fixed(text.begin(), text.end(), number, decimals);
  ASSERT_EQ(error, std::errc());
  ASSERT_EQ(std::string_view(text.begin(), end), std::string_view(expected.begin(), expected_end));
}

TEST(FixedTextTest, WritesTheCharactersOfToChars) {
  using Limits = std::numeric_limits<double>;
  for (const double number : {0.0,
                              0.5,
                              1.0,
                              1.5,
                              2.5,
                              0.125,
                              0.375,
                              0.05,
                              9.5,
                              9.96,
                              99.995,
                              999999999.0,
                              999999999.4999999,
                              999999999.5,
                              999999999.9999999,
                              1e9,
                              1e15,
                              1e22,
                              1e-5,
                              5e-10,
                              1e-300,
                              Limits::denorm_min(),
                              Limits::min(),
                              Limits::max(),
                              Limits::infinity(),
                              0x1p-22,
                              0x1p-23,
                              0x1p-50,
                              0x1.fffffffffffffp29,
                              9.80665,
                              123.4565,
                              4.35,
                              2.675})
    for (int decimals = -1; decimals < 14; ++decimals) {
      expect_as_to_chars(number, decimals);
      expect_as_to_chars(-number, decimals);
    }
}

TEST(FixedTextTest, WritesRandomNumbersAsToCharsDoes) {
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal;
  int ties = 0;
  for (int i = 0; i < 100'000; ++i) {
    const auto decimals = static_cast<int>(random() % 11);
    const double any = std::bit_cast<double>(random());
    if (!std::isnan(any)) expect_as_to_chars(any, decimals);
    for (const double scale : {1e-9, 1e-3, 1.0, 1e3, 1e8, 1e11}) expect_as_to_chars(scale * normal(random), decimals);
    // Half of these are half-way between two texts, and so must be even.
    const auto places = static_cast<int>(random() % 12);
    const double dyadic = std::ldexp(static_cast<double>(random() % 1'000'000), -places);
    ties += std::fmod(dyadic * std::pow(10, decimals), 1) == 0.5 ? 1 : 0;
    expect_as_to_chars(dyadic, decimals);
    if (HasFatalFailure()) return;
  }
  EXPECT_GT(ties, 5000);
}

TEST(FixedTextTest, RefusesATextWithoutRoom) {
  std::array<char, 6> text;
  EXPECT_EQ(std::string(text.begin(), write_fixed(text.begin(), text.end(), -12.25, 2).ptr), "-12.25");
  for (std::size_t size = 0; size < text.size(); ++size)
    EXPECT_EQ(write_fixed(text.data(), text.data() + size, -12.25, 2).ec, std::errc::value_too_large);
}

}  // namespace
}  // namespace imud
