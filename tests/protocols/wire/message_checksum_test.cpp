// Checksums of CAN messages, by vectors that others have published.
#include "protocols/wire/message_checksum.hpp"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "tests/protocols/recording.hpp"

namespace imud {
namespace {

using Profile = ChecksumProfile;

std::vector<std::byte> bytes_of(std::initializer_list<int> numbers) {
  std::vector<std::byte> bytes;
  for (const int number : numbers) bytes.push_back(static_cast<std::byte>(number));
  return bytes;
}

// The checksum of `data`, with its own byte before it.
unsigned sum(const MessageChecksum& checksum, std::initializer_list<int> data, unsigned counter = 0) {
  std::vector<std::byte> message(checksum.size(), std::byte{0xA5});
  const std::vector<std::byte> rest = bytes_of(data);
  message.insert(message.end(), rest.begin(), rest.end());
  return checksum.of(message, 0, counter);
}

// AUTOSAR, Specification of CRC Routines, the tables of check values of its CRC-8 and CRC-8H2F.
TEST(MessageChecksumTest, PlainCrcsHaveTheCheckValuesOfAutosar) {
  const MessageChecksum j1850{.profile = Profile::j1850}, h2f{.profile = Profile::h2f};
  const struct {
    std::initializer_list<int> data;
    unsigned j1850, h2f;
  } vectors[] = {
      {{0x00, 0x00, 0x00, 0x00}, 0x59, 0x12},
      {{0xF2, 0x01, 0x83}, 0x37, 0xC2},
      {{0x0F, 0xAA, 0x00, 0x55}, 0x79, 0xC6},
      {{0x00, 0xFF, 0x55, 0x11}, 0xB8, 0x77},
      {{0x33, 0x22, 0x55, 0xAA, 0xBB, 0xCC, 0xDD, 0xEE, 0xFF}, 0xCB, 0x11},
      {{0x92, 0x6B, 0x55}, 0x8C, 0x33},
      {{0xFF, 0xFF, 0xFF, 0xFF}, 0x74, 0x6C},
      {{'1', '2', '3', '4', '5', '6', '7', '8', '9'}, 0x4B, 0xDF},
  };
  for (const auto& one : vectors) {
    EXPECT_EQ(sum(j1850, one.data), one.j1850);
    EXPECT_EQ(sum(h2f, one.data), one.h2f);
  }
}

// The tests of the Python package autosar-e2e (zariiii9003), data id 0x123, the counter in the low nibble of byte 1.
// In its test for `nibble`, bits 8 to 11 of the id are in the high nibble.
TEST(MessageChecksumTest, Profile1And11AgreeWithAnotherImplementation) {
  const auto with = [](Profile profile, DataIdMode mode) {
    return MessageChecksum{.profile = profile, .mode = mode, .data_id = 0x123};
  };
  for (const Profile profile : {Profile::e2e_p01, Profile::e2e_p11}) {
    EXPECT_EQ(sum(with(profile, DataIdMode::both), {0, 0, 0, 0, 0, 0, 0}, 0), 0xCCU);
    EXPECT_EQ(sum(with(profile, DataIdMode::both), {1, 0, 0, 0, 0, 0, 0}, 1), 0x91U);
    EXPECT_EQ(sum(with(profile, DataIdMode::nibble), {0x10, 0, 0, 0, 0, 0, 0}, 0), 0x2AU);
    EXPECT_EQ(sum(with(profile, DataIdMode::nibble), {0x11, 0, 0, 0, 0, 0, 0}, 1), 0x77U);
  }
  EXPECT_EQ(sum(with(Profile::e2e_p01, DataIdMode::alt), {0, 0, 0, 0, 0, 0, 0}, 0), 0xCEU);
  EXPECT_EQ(sum(with(Profile::e2e_p01, DataIdMode::alt), {1, 0, 0, 0, 0, 0, 0}, 1), 0x02U);
  EXPECT_EQ(sum(with(Profile::e2e_p01, DataIdMode::low), {0, 0, 0, 0, 0, 0, 0}, 0), 0xCEU);
  EXPECT_EQ(sum(with(Profile::e2e_p01, DataIdMode::low), {1, 0, 0, 0, 0, 0, 0}, 1), 0x93U);
}

// The same package.
TEST(MessageChecksumTest, Profile2AgreesWithAnotherImplementation) {
  MessageChecksum checksum{.profile = Profile::e2e_p02};
  EXPECT_EQ(sum(checksum, {1, 0, 0, 0, 0, 0, 0}, 1), 0x45U);
  for (std::size_t i = 0; i < checksum.data_ids.size(); ++i) checksum.data_ids[i] = static_cast<std::uint8_t>(i);
  EXPECT_EQ(sum(checksum, {2, 2, 3, 4, 5, 6, 7}, 2), 0xBCU);
  EXPECT_EQ(sum(checksum, {1, 2, 3, 4, 5, 6, 7}, 1), 0x61U);
}

// The same package: the checksum is sent low byte first, so that 0xCA1C is 1C CA.
TEST(MessageChecksumTest, Profile5AgreesWithAnotherImplementation) {
  const MessageChecksum checksum{.profile = Profile::e2e_p05, .data_id = 0x1234};
  EXPECT_EQ(sum(checksum, {0, 0, 0, 0, 0, 0}), 0xCA1CU);
  EXPECT_EQ(sum(checksum, {1, 0, 0, 0, 0, 0}), 0x8DCFU);
  std::vector<std::byte> message(16);
  EXPECT_EQ(checksum.of(message, 8, 0), 0x9128U);
  message[10] = std::byte{1};
  EXPECT_EQ(checksum.of(message, 8, 1), 0xD6FBU);
}

// One message of 15 bytes, the counter in the low nibble of the first. autosar-e2e and crccheck give these checksums;
// so does cantools (autosar/end_to_end.py) for profiles 2 and 5.
TEST(MessageChecksumTest, AllKindsOfALongMessageAgreeWithOtherImplementations) {
  const auto of = [](const char* text, int first, unsigned counter) {
    return sum(parse_checksum(text).value(),
               {first, 0x11, 0x22, 0x33, 0x44, 0x55, 0x66, 0x77, 0x88, 0x99, 0xAA, 0xBB, 0xCC, 0xDD, 0xEE}, counter);
  };
  EXPECT_EQ(of("j1850", 0x00, 0), 0x9FU);
  EXPECT_EQ(of("h2f", 0x00, 0), 0xFAU);
  EXPECT_EQ(of("e2e_p01:0xABC:both", 0x09, 9), 0x19U);
  EXPECT_EQ(of("e2e_p01:0xABC:low", 0x09, 9), 0xFAU);
  EXPECT_EQ(of("e2e_p01:0xABC:alt", 0x09, 9), 0xBFU);
  EXPECT_EQ(of("e2e_p01:0xABC:nibble", 0xA9, 9), 0xADU);
  EXPECT_EQ(of("e2e_p02:F0F1F2F3F4F5F6F7F8F9FAFBFCFDFEFF", 0x0D, 13), 0x6AU);
  EXPECT_EQ(sum(parse_checksum("e2e_p05:0xBEEF").value(),
                {0x11, 0x22, 0x33, 0x44, 0x55, 0x66, 0x77, 0x88, 0x99, 0xAA, 0xBB, 0xCC, 0xDD, 0xEE}, 0x11),
            0x551FU);
}

TEST(MessageChecksumTest, AnyPlaceOfTheChecksumIsLeftOut) {
  for (const char* text :
       {"j1850", "h2f", "e2e_p01:291", "e2e_p02:000102030405060708090A0B0C0D0E0F", "e2e_p11:0x123"}) {
    const auto checksum = parse_checksum(text);
    ASSERT_TRUE(checksum) << text;
    const auto first = checksum->of(bytes_of({0xFF, 1, 2, 3}), 0, 5);
    EXPECT_EQ(checksum->of(bytes_of({1, 0xFF, 2, 3}), 1, 5), first) << text;
    EXPECT_EQ(checksum->of(bytes_of({1, 2, 3, 0}), 3, 5), first) << text;
    EXPECT_NE(checksum->of(bytes_of({1, 2, 2, 0}), 3, 5), first) << text;
  }
}

TEST(MessageChecksumTest, TextsOfEveryKindAreParsed) {
  const auto p01 = parse_checksum("e2e_p01:0xABC:nibble");
  ASSERT_TRUE(p01);
  EXPECT_EQ(p01->profile, Profile::e2e_p01);
  EXPECT_EQ(p01->data_id, 0xABC);
  EXPECT_EQ(p01->mode, DataIdMode::nibble);
  EXPECT_EQ(p01->counter_values(), 15U);
  const auto p02 = parse_checksum("e2e_p02:FF0102030405060708090a0b0c0d0e80");
  ASSERT_TRUE(p02);
  EXPECT_EQ(p02->data_ids[0], 0xFF);
  EXPECT_EQ(p02->data_ids[15], 0x80);
  EXPECT_EQ(p02->counter_values(), 16U);
  const auto p05 = parse_checksum("e2e_p05:4660");
  ASSERT_TRUE(p05);
  EXPECT_EQ(p05->data_id, 0x1234);
  EXPECT_EQ(p05->size(), 2U);
  for (const char* text :
       {"", "crc", "j1850:1", "e2e_p01", "e2e_p01:", "e2e_p01:70000", "e2e_p01:1:none", "e2e_p01:1:both:2",
        "e2e_p02:00", "e2e_p02:0001020304050607080910111213141X", "e2e_p05:1:both", "e2e_p11:1:alt", "e2e_p11:1:low"})
    EXPECT_FALSE(parse_checksum(text)) << text;
  // AUTOSAR's E2E library, E2E_P01_DATAID_NIBBLE: "the high nibble of the high byte is not used. This is applicable
  // for the IDs up to 12 bits."
  for (const std::string profile : {"e2e_p01", "e2e_p11"}) {
    EXPECT_TRUE(parse_checksum(profile + ":0xFFF:nibble")) << profile;
    EXPECT_FALSE(parse_checksum(profile + ":0x1000:nibble")) << profile;
    EXPECT_TRUE(parse_checksum(profile + ":0xFFFF:both")) << profile;
  }
}

}  // namespace
}  // namespace imud
