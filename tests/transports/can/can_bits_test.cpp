#include "transports/can/can_bits.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <string_view>

#include "tests/transports/can/can_serialiser.hpp"

namespace imud {
namespace {

double total(const CanBits& bits) { return bits.nominal + bits.data; }

std::vector<std::byte> hex(std::string_view text) {
  std::vector<std::byte> bytes;
  for (; !text.empty(); text.remove_prefix(2))
    bytes.push_back(static_cast<std::byte>(std::stoul(std::string(text.substr(0, 2)), nullptr, 16)));
  return bytes;
}

// Frame lengths of ISO 11898-1 as other tools calculate them: 8 data bytes are at most 135 (11-bit identifier) and
// 160 (29-bit) bits with interframe space; none, 55 and 80.
TEST(CanBits, ClassicFramesAreAsLongAsInOtherTools) {
  const CanHeader standard{};
  const CanHeader extended{.extended = true};
  EXPECT_EQ(most_can_bits(standard, 0).nominal, 55.0);
  EXPECT_EQ(most_can_bits(standard, 6).nominal, 115.0);
  EXPECT_EQ(most_can_bits(standard, 7).nominal, 125.0);
  EXPECT_EQ(most_can_bits(standard, 8).nominal, 135.0);
  EXPECT_EQ(most_can_bits(extended, 0).nominal, 80.0);
  EXPECT_EQ(most_can_bits(extended, 7).nominal, 150.0);
  EXPECT_EQ(most_can_bits(extended, 8).nominal, 160.0);
}

// Lengths that canbusload -e of can-utils 2020.11 printed for these frames.
TEST(CanSerialiser, FramesAreAsLongAsInCanUtils) {
  EXPECT_EQ(CanSerialiser({.id = 0x123}, hex("0000000000000000")).length(), 125);
  EXPECT_EQ(CanSerialiser({.id = 0x0CF02A80, .extended = true}, hex("807D007C807E0004")).length(), 141);
  EXPECT_EQ(CanSerialiser({.id = 0x121}, hex("D50300002BFC")).length(), 101);
  EXPECT_EQ(CanSerialiser({.id = 0x122}, hex("640038FF2C01")).length(), 101);
  EXPECT_EQ(CanSerialiser({.id = 0}, {}).length(), 53);
}

// The mean over all identifiers, of a table that was calculated independently.
TEST(CanBits, AverageIsThatOfTheTable) {
  std::mt19937 random(1);
  struct Row {
    bool extended;
    std::size_t bytes;
    double bits;
  };
  for (const auto& [extended, bytes, bits] : {Row{false, 0, 49.0},
                                              {false, 6, 97.8},
                                              {false, 7, 106.3},
                                              {false, 8, 114.3},
                                              {true, 0, 69.7},
                                              {true, 6, 118.6},
                                              {true, 7, 127.1},
                                              {true, 8, 135.1}}) {
    constexpr int all = 5000;
    double sum = 0;
    for (int i = 0; i < all; ++i)
      sum += total(average_can_bits(
          {.id = static_cast<std::uint32_t>(random()) & (extended ? 0x1FFFFFFFU : 0x7FFU), .extended = extended},
          bytes));
    EXPECT_NEAR(sum / all, bits, 0.1) << bytes;
  }
}

// The mean length of frames with one identifier and random data is the average, and no frame is longer than the
// longest.
TEST(CanBits, AverageAndMostAreThoseOfSerialisedFrames) {
  std::mt19937 random(2);
  for (const bool extended : {false, true})
    for (const bool remote : {false, true})
      for (std::size_t size = 0; size <= 8; ++size)
        for (const std::uint32_t id : {0U, 0x123U, 0x7FFU, static_cast<std::uint32_t>(random() & 0x7FFU)}) {
          const CanHeader header{.id = extended ? id * 0x3FFFFU : id, .extended = extended, .remote = remote};
          constexpr int all = 2000;
          double sum = 0, most = 0;
          std::vector<std::byte> data(size);
          for (int i = 0; i < all; ++i) {
            for (std::byte& byte : data) byte = static_cast<std::byte>(random());
            const double length = CanSerialiser(header, data).length();
            ASSERT_EQ(total(can_bits({data, header})), length);
            sum += length;
            most = std::max(most, length);
          }
          // The CRC of few or no data is not random.
          EXPECT_NEAR(sum / all, total(average_can_bits(header, size)), size < 2 || remote ? 2.5 : 0.2)
              << id << " " << size << extended << remote;
          EXPECT_LE(most, total(most_can_bits(header, size)));
        }
}

// CAN FD by the fields of the standard; not compared with a controller.
TEST(CanBits, FdHasFixedStuffBitsInItsCrc) {
  const CanHeader fd{.fd = true, .bit_rate_switch = true};
  // 17 bits to the bit rate switch with 4 stuff bits, and 13 from the CRC delimiter on. 5 + 512 bits of control and
  // data; stuff count, CRC and fixed stuff bits are 4 + 21 + 7.
  EXPECT_EQ(most_can_bits(fd, 64).nominal, 17 + 4 + 13);
  EXPECT_EQ(most_can_bits(fd, 64).data, 5 + 512 + 129 + 32);
  EXPECT_EQ(most_can_bits(fd, 16).data, 5 + 128 + 33 + 4 + 17 + 6) << "the shorter CRC";
  CanHeader slow = fd;
  slow.bit_rate_switch = false;
  EXPECT_EQ(most_can_bits(slow, 64).nominal, total(most_can_bits(fd, 64)));
  EXPECT_EQ(most_can_bits(slow, 64).data, 0.0);
  const CanBits average = average_can_bits({.id = 0x123, .fd = true, .bit_rate_switch = true}, 64);
  EXPECT_NEAR(average.nominal, 30, 0.5) << "this identifier causes no stuff bit";
  EXPECT_NEAR(average.data, 5 + 512 + 517 / 30.0 + 32, 0.5) << "of random bits one in 30 is followed by a stuff bit";
}

}  // namespace
}  // namespace imud
