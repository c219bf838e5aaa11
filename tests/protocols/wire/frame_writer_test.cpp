// FrameWriter, FieldReader and number_in.
#include "protocols/wire/frame_writer.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <random>
#include <vector>

#include "core/numbers/number_text.hpp"

namespace imud {
namespace {

using boost::endian::order;

std::vector<unsigned> bytes_of(std::span<const std::byte> bytes) {
  std::vector<unsigned> all;
  for (const std::byte byte : bytes) all.push_back(std::to_integer<unsigned>(byte));
  return all;
}
using Octets = std::vector<unsigned>;

TEST(FrameWriter, PutsNumbersInItsOrder) {
  const auto out = std::make_unique<FrameBuffer>();
  FrameWriter<order::big> big(*out, 64);
  big.put(std::uint8_t{0x75});
  big.put(std::uint16_t{0x0102});
  big.put(1.0F);
  big.put(-2.0);
  big.put_low_bytes(0xABCDEF, 3);
  big.put_text("ok");
  big.set_byte(0, 0x65);
  EXPECT_EQ(bytes_of(big.written()),
            (Octets{0x65, 1, 2, 0x3F, 0x80, 0, 0, 0xC0, 0, 0, 0, 0, 0, 0, 0, 0xAB, 0xCD, 0xEF, 'o', 'k'}));
  big.push();
  FrameWriter<order::little> little(*out, 64);
  little.put(std::uint32_t{0x01020304});
  little.put_floats({1, 0, -2});
  little.fill(18);
  EXPECT_EQ(bytes_of(little.written()), (Octets{4, 3, 2, 1, 0, 0, 0x80, 0x3F, 0, 0, 0, 0, 0, 0, 0, 0xC0, 0, 0}));
  little.push();
  ASSERT_EQ(out->frames().size(), 2U);
  EXPECT_EQ(out->frames()[0].bytes.size(), 20U);
  EXPECT_EQ(out->frames()[1].bytes.size(), 18U);
}

TEST(FrameWriter, RoundsUpToTheEndsOfTwosComplement) {
  const auto out = std::make_unique<FrameBuffer>();
  FrameWriter<order::big> writer(*out, 64);
  for (const double number : {-1.4, 1.5, 1e30, -1e30}) writer.put_rounded(number, 2);
  EXPECT_EQ(bytes_of(writer.written()), (Octets{0xFF, 0xFF, 0, 2, 0x7F, 0xFF, 0x80, 0}));
}

TEST(ToInteger, IsLlround) {
  for (const double number :
       {0.0, -0.0, 0.49999999999999994, 0.5, 0.50000000000000011, 1.5, 2.5, 8388606.5, 4503599627370495.5, 9e18})
    for (const double value : {number, -number}) EXPECT_EQ(to_integer(value), std::llround(value)) << value;
  std::mt19937_64 random(1);
  for (int i = 0; i < 100'000; ++i) {
    const double value = std::ldexp(std::uniform_real_distribution(-1.0, 1.0)(random), i % 62);
    ASSERT_EQ(to_integer(value), std::llround(value)) << value;
  }
}

TEST(FrameWriter, LeavesOutWhatIsBeyond) {
  const auto out = std::make_unique<FrameBuffer>();
  FrameWriter<order::little> writer(*out, 5);
  writer.put(std::uint32_t{1});
  writer.put(std::uint16_t{2});
  writer.set_byte(4, 9);
  EXPECT_EQ(writer.size(), 4U);
  while (!out->room(4000).empty()) out->push(4000);
  while (!out->room(1).empty()) out->push(1);
  FrameWriter<order::little> none(*out, 5);
  none.put(std::uint8_t{1});
  none.fill(4);
  none.push();
  EXPECT_EQ(none.size(), 0U);
}

TEST(FieldReader, TakesThemBackAndKnowsWhenThereAreNoMore) {
  const auto out = std::make_unique<FrameBuffer>();
  FrameWriter<order::big> writer(*out, 64);
  writer.put(std::uint16_t{0x0102});
  writer.put_floats({1, 2.5, -3});
  writer.put(1e300);
  FieldReader<order::big> reader(writer.written());
  EXPECT_EQ(reader.take<std::uint16_t>(), 0x0102);
  EXPECT_EQ(reader.take_floats(), Vector3(1, 2.5, -3));
  EXPECT_FALSE(reader.is_done());
  EXPECT_EQ(reader.take<double>(), 1e300);
  EXPECT_TRUE(reader.is_done());
  EXPECT_EQ(reader.take<std::uint8_t>(), 0);
  EXPECT_FALSE(reader.is_whole());
}

TEST(NumberIn, IsTheWholeTextOrNone) {
  EXPECT_EQ(number_in<unsigned>("0721", 16), 0x721U);
  EXPECT_EQ(number_in<double>("-1.5e3"), -1500.0);
  for (const char* text : {"", "+1", " 1", "1 ", "1x", "-1", "4294967296"})
    EXPECT_FALSE(number_in<std::uint32_t>(text)) << text;
  EXPECT_FALSE(number_in<double>("1.0.0"));
  EXPECT_EQ(finite_number_in("-1.5e3"), -1500.0);
  for (const char* text : {"", "inf", "-inf", "nan", "1e999"}) EXPECT_FALSE(finite_number_in(text)) << text;
}

}  // namespace
}  // namespace imud
