#include "tools/allan/still_recording.hpp"

#include <gtest/gtest.h>

#include <optional>
#include <stdexcept>
#include <utility>
#include <vector>

namespace imud {
namespace {

TEST(Columns, NamesSelectTheChannels) {
  using Columns = std::vector<std::optional<std::size_t>>;
  EXPECT_EQ(parse_columns("", 3), (Columns{0, 1, 2}));
  EXPECT_EQ(parse_columns("", 6).size(), 6U);
  EXPECT_EQ(parse_columns("-,accel_z,gyro_x", 3), (Columns{std::nullopt, 5, 0}));
  for (const auto& [text, columns] : {std::pair("", 7U), std::pair("gyro_x", 2U), std::pair("gyro_x,gyro_x", 2U),
                                      std::pair("-", 1U), std::pair("gyro", 1U), std::pair("gyro_x,", 2U)})
    EXPECT_THROW(parse_columns(text, columns), std::invalid_argument) << text;
}

}  // namespace
}  // namespace imud
