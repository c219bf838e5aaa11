#include "transports/can_bits.hpp"

#include <gtest/gtest.h>

namespace imud {
namespace {

// Frame lengths of ISO 11898-1 as other tools calculate them: 8 data bytes are at most 135 (11-bit identifier) and
// 160 (29-bit) bits with interframe space; none, 55 and 80.
TEST(CanBits, ClassicFramesAreAsLongAsInOtherTools) {
  const CanHeader standard{};
  const CanHeader extended{.extended = true};
  EXPECT_EQ(can_bits(standard, 0).nominal, 55.0);
  EXPECT_EQ(can_bits(standard, 6).nominal, 115.0);
  EXPECT_EQ(can_bits(standard, 7).nominal, 125.0);
  EXPECT_EQ(can_bits(standard, 8).nominal, 135.0);
  EXPECT_EQ(can_bits(extended, 0).nominal, 80.0);
  EXPECT_EQ(can_bits(extended, 7).nominal, 150.0);
  EXPECT_EQ(can_bits(extended, 8).nominal, 160.0);
}

}  // namespace
}  // namespace imud
