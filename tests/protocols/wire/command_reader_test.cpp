#include "protocols/wire/command_reader.hpp"

#include <gtest/gtest.h>

#include <string>

namespace imud {
namespace {

// Records the lines of a host, and the overflows.
class CommandReaderTest : public testing::Test {
 protected:
  void feed(std::string_view text, DeviceTime now) {
    reader_.feed(
        std::as_bytes(std::span(text)), now, [&](std::string_view line) { log_ += "[" + std::string(line) + "]"; },
        [&] { log_ += "(left out)"; });
  }
  CommandReader<4> reader_;
  std::string log_;
};

TEST_F(CommandReaderTest, LeavesOutLinesThatAreEmptyOrTooLong) {
  for (const char c : std::string("ab\r\n\ncdefg\rhijk\n")) feed({&c, 1}, {});
  EXPECT_EQ(log_, "[ab](left out)[hijk]");
}

TEST_F(CommandReaderTest, DiscardsAnUnfinishedLineAfterItsTimeoutOnly) {
  constexpr DeviceTime begin{7};
  feed("ab", begin);
  feed("c", begin + CommandReader<4>::timeout);
  feed("d\n", begin + 2 * CommandReader<4>::timeout);
  EXPECT_EQ(log_, "[abcd]");
  feed("toolong", begin + 2 * CommandReader<4>::timeout);
  feed("e\n", begin + 3 * CommandReader<4>::timeout + Nanoseconds{1});
  EXPECT_EQ(log_, "[abcd][e]");
}

TEST_F(CommandReaderTest, NothingIsDiscardedWhenTheClockIsSet) {
  constexpr Nanoseconds step = std::chrono::hours(1);
  feed("ab", {});
  reader_.step_clock(step);
  feed("c\n", DeviceTime{} + step + CommandReader<4>::timeout);
  EXPECT_EQ(log_, "[abc]");
}

}  // namespace
}  // namespace imud
