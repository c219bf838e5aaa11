// Checks that are in no catalogue, and what one length of frames leaves open.
#include "tools/checks/check_search.hpp"

#include <gtest/gtest.h>

#include <random>

#include "tests/protocols/recording.hpp"
#include "tools/checks/crc_solver.hpp"
#include "tools/find/frame_finder.hpp"

namespace imud {
namespace {

// Frames "5A C3", a type, random bytes, and a CRC.
std::vector<std::byte> stream_of(const CrcParameters& parameters, std::initializer_list<std::size_t> lengths,
                                 bool is_big) {
  std::mt19937_64 random(3);
  const Crc crc(parameters);
  std::vector<std::byte> stream;
  for (int k = 0; k < 200; ++k)
    for (const std::size_t length : lengths) {
      std::vector<std::byte> frame = {std::byte{0x5A}, std::byte{0xC3}, static_cast<std::byte>(length)};
      const std::vector<std::byte> data = random_bytes(length - 3, random);
      frame.insert(frame.end(), data.begin(), data.end());
      const std::uint64_t value = crc.finish(crc.update(crc.start(), frame));
      for (std::size_t i = 0; i < parameters.width / 8; ++i)
        frame.push_back(static_cast<std::byte>(value >> 8 * (is_big ? parameters.width / 8 - 1 - i : i)));
      stream.insert(stream.end(), frame.begin(), frame.end());
    }
  return stream;
}

TEST(CheckSearch, FindsPolynomialsOfNoCatalogue) {
  const CrcParameters unknown[] = {{16, 0x9EB3, 0x1234, false, false, 0x00FF},
                                   {16, 0x9EB3, 0xFFFF, true, true, 0},
                                   {24, 0x9D6A53, 0, false, false, 0xFFFFFF},
                                   {32, 0x93A409EB, 0xDEADBEEF, true, true, 0xFFFFFFFF},
                                   {32, 0x93A409EB, 0x1, false, true, 0}};
  for (const CrcParameters& parameters : unknown)
    for (const bool is_big : {false, true}) {
      SCOPED_TRACE(std::to_string(parameters.width) + " " + std::to_string(parameters.poly));
      const auto found = find_frames(stream_of(parameters, {20}, is_big));
      ASSERT_TRUE(found);
      ASSERT_EQ(found->messages.size(), 1U);
      ASSERT_EQ(found->messages[0].checks.size(), 1U);
      const FoundCheck& check = found->messages[0].checks[0];
      EXPECT_EQ(check.at, 20U);
      EXPECT_EQ(check.is_big, is_big);
      EXPECT_EQ(check.agreeing, check.compared);
      ASSERT_TRUE(check.forms.front().own);
      EXPECT_EQ(check.forms.front().own->poly, parameters.poly);
      EXPECT_EQ(check.forms.front().own->refin, parameters.refin);
      EXPECT_EQ(check.forms.front().own->refout, parameters.refout);
    }
}

// Two lengths decide initial value and final XOR, but for what no frame shows.
TEST(CheckSearch, TwoLengthsGiveTheInitialValue) {
  const CrcParameters parameters{16, 0x9EB3, 0x1234, false, false, 0x00FF};
  const auto found = find_frames(stream_of(parameters, {20, 33}, true));
  ASSERT_TRUE(found);
  ASSERT_EQ(found->messages.size(), 2U);
  std::mt19937_64 random(9);
  const std::vector<std::byte> other = random_bytes(57, random);
  for (const FoundMessage& message : found->messages) {
    ASSERT_EQ(message.checks.size(), 1U);
    ASSERT_TRUE(message.checks[0].forms.front().own);
    const Crc crc(*message.checks[0].forms.front().own), wanted(parameters);
    EXPECT_EQ(crc.finish(crc.update(crc.start(), other)), wanted.finish(wanted.update(wanted.start(), other)));
    ASSERT_TRUE(message.length_field);
    EXPECT_TRUE(message.length_field->is_certain);
    EXPECT_EQ(message.length_field->at, 2U);
  }
}

TEST(CrcSolver, RunsBackwards) {
  std::mt19937_64 random(4);
  const std::vector<std::byte> bytes = random_bytes(31, random);
  for (const CrcAlgorithm& algorithm : crc_algorithms()) {
    const Crc crc(algorithm.parameters);
    const std::byte zero{0};
    const std::uint64_t state = crc.update(crc.start(), bytes);
    EXPECT_EQ(initial_value(algorithm.parameters, bytes, 0, crc.finish(state)), algorithm.parameters.init)
        << algorithm.name;
    EXPECT_EQ(initial_value(algorithm.parameters, bytes, 1, crc.finish(crc.update(state, {&zero, 1}))),
              algorithm.parameters.init)
        << algorithm.name;
  }
}

}  // namespace
}  // namespace imud
