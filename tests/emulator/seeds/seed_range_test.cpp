#include <gtest/gtest.h>

#include "emulator/seeds/seeds.hpp"

namespace imud {
namespace {

TEST(SeedRangeTest, HasTenMillionSeedsAtMost) {
  const auto size = [](std::string_view text) {
    const auto range = SeedRange::parse(text);
    return range ? range->size() : 0;
  };
  EXPECT_EQ(size("7"), 1U);
  EXPECT_EQ(size("7..7"), 1U);
  EXPECT_EQ(size("8..12"), 5U);
  EXPECT_EQ(size("1..10000000"), 10'000'000U);
  EXPECT_EQ(size("1..10000001"), 0U);
  EXPECT_EQ(size("5..10000004"), 10'000'000U);
  EXPECT_EQ(size("18446744073709551606..18446744073709551615"), 10U);
  EXPECT_EQ(size("0..18446744073709551615"), 0U);
  for (const char* text : {"", "..", "1..", "..2", "2..1", "-1", "1...2", "1..2..3", "1.5", " 1"})
    EXPECT_EQ(size(text), 0U) << text;
}

}  // namespace
}  // namespace imud
