#include "protocols/wire/shortest_text.hpp"

#include <gtest/gtest.h>

#include <array>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <limits>
#include <random>
#include <string>

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

}  // namespace
}  // namespace imud
