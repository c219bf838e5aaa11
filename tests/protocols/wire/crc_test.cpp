// Every algorithm of the table against the check value that the catalogue gives for it, and against Boost's CRCs.
#include "protocols/wire/crc.hpp"

#include <gtest/gtest.h>

#include <boost/crc.hpp>
#include <set>
#include <string_view>

namespace imud {
namespace {

std::span<const std::byte> bytes_of(std::string_view text) { return std::as_bytes(std::span(text)); }

TEST(Crc, GivesTheCheckValueOfEveryAlgorithm) {
  std::set<std::string_view> names;
  for (const CrcAlgorithm& algorithm : crc_algorithms()) {
    SCOPED_TRACE(algorithm.name);
    EXPECT_TRUE(names.insert(algorithm.name).second);
    EXPECT_EQ(find_crc(algorithm.name), &algorithm);
    const Crc crc(algorithm.parameters);
    EXPECT_EQ(crc.finish(crc.update(crc.start(), bytes_of("123456789"))), algorithm.check);
    // In pieces.
    const std::uint64_t first = crc.update(crc.start(), bytes_of("1234"));
    EXPECT_EQ(crc.finish(crc.update(first, bytes_of("56789"))), algorithm.check);
  }
  EXPECT_GT(names.size(), 70U);
}

TEST(Crc, AgreesWithBoost) {
  const std::string_view text = "The quick brown fox jumps over the lazy dog";
  boost::crc_optimal<16, 0x1021, 0x1D0F> fujitsu;
  boost::crc_optimal<32, 0x04C11DB7, 0, 0, true, true> novatel;
  fujitsu.process_bytes(text.data(), text.size());
  novatel.process_bytes(text.data(), text.size());
  const Crc first(find_crc("crc16/spi-fujitsu")->parameters);
  const Crc second({.width = 32, .poly = 0x04C11DB7, .refin = true, .refout = true});
  EXPECT_EQ(first.finish(first.update(first.start(), bytes_of(text))), fujitsu.checksum());
  EXPECT_EQ(second.finish(second.update(second.start(), bytes_of(text))), novatel.checksum());
}

TEST(Crc, FindsTheCataloguesSpellings) {
  EXPECT_EQ(find_crc("CRC-16/XMODEM"), find_crc("crc16/xmodem"));
  EXPECT_NE(find_crc("crc-32/mpeg-2"), nullptr);
  for (const char* other : {"", "crc", "crc16", "crc16/", "crc16/xmode", "crc--16/xmodem", "xxx-16/xmodem"})
    EXPECT_EQ(find_crc(other), nullptr) << other;
}

}  // namespace
}  // namespace imud
