// The SDO server and LSS of the CANopen device. Known transfers are those of python-canopen's test_sdo.py
// (github.com/christiansandberg/canopen 5382f24), whose object 2000 is a text, too.
#include "tests/protocols/canopen/canopen_unit.hpp"

namespace imud {
namespace {

using canopen_test::Unit;
using namespace std::chrono_literals;

class CanopenSdo : public testing::Test {
 protected:
  CanopenSdo() {
    unit.node_id = 2;
    unit.pass(0s);
  }
  Unit unit{"node_id=2 vendor_id=4 heartbeat_ms=0"};
};

TEST_F(CanopenSdo, KnownExpeditedTransfers) {
  EXPECT_EQ(unit.send("602#4018100100000000"), "582#4318100104000000");
  EXPECT_EQ(unit.send("602#2B171000A00F0000"), "582#6017100000000000");
  EXPECT_EQ(unit.read(0x1017), 4000U);
  EXPECT_EQ(unit.send("602#22171000E8030000"), "582#6017100000000000") << "without a size";
  EXPECT_EQ(unit.read(0x1017), 1000U);
  EXPECT_EQ(unit.send("602#2200200041424344"), "582#6000200000000000") << "a text without a size";
  EXPECT_EQ(unit.send("602#4000200000000000"), "582#4300200041424344");
}

TEST_F(CanopenSdo, KnownSegmentedTransfers) {
  EXPECT_EQ(unit.send("602#210020000D000000"), "582#6000200000000000");
  EXPECT_EQ(unit.send("602#0041206C6F6E6720"), "582#2000000000000000");
  EXPECT_EQ(unit.send("602#13737472696E6700"), "582#3000000000000000");
  EXPECT_EQ(unit.send("602#4000200000000000"), "582#410020000D000000");
  EXPECT_EQ(unit.send("602#6000000000000000"), "582#0041206C6F6E6720");
  EXPECT_EQ(unit.send("602#7000000000000000"), "582#13737472696E6700");
  EXPECT_EQ(unit.send("602#2000200000000000 602#0031323334353637 602#1A38390000000000 602#0F00000000000000"),
            "582#6000200000000000 582#2000000000000000 582#3000000000000000 582#2000000000000000");
  EXPECT_EQ(unit.send("602#4000200000000000"), "582#4100200009000000") << "no size was announced";
  EXPECT_EQ(unit.send("602#2100200000000000 602#0F00000000000000"), "582#6000200000000000 582#2000000000000000");
  EXPECT_EQ(unit.send("602#4000200000000000"), "582#4100200000000000") << "an empty text";
  EXPECT_EQ(unit.send("602#6000000000000000"), "582#0F00000000000000");
}

TEST_F(CanopenSdo, KnownBlockTransfers) {
  EXPECT_EQ(unit.send("602#C60020001E000000"), "582#A40020007F000000");
  EXPECT_EQ(unit.send("602#0141207265616C6C 602#0279207265616C6C 602#0379206C6F6E6720 602#04737472696E672E"), "");
  EXPECT_EQ(unit.send("602#852E2E0000000000"), "582#A2057F0000000000");
  EXPECT_EQ(unit.send("602#D545690000000000"), "582#A100000000000000");
  EXPECT_EQ(unit.send("602#4000200000000000"), "582#410020001E000000");
}

TEST_F(CanopenSdo, ABlockUploadEndsWithItsCrc) {
  unit.send(
      "602#210020001A000000 602#0054696E79204E6F 602#106465202D204D65 602#00676120446F6D61 602#15696E7320210000");
  EXPECT_EQ(unit.send("602#A40020007F000000"), "582#C60020001A000000");
  EXPECT_EQ(unit.send("602#A300000000000000"),
            "582#0154696E79204E6F 582#026465202D204D65 582#03676120446F6D61 582#84696E7320210000");
  EXPECT_EQ(unit.send("602#A2047F0000000000"), "582#C940E10000000000");
  EXPECT_EQ(unit.send("602#A100000000000000"), "");
  EXPECT_EQ(unit.count("sdo_aborts"), 0U);
  // Below the client's threshold, the upload is an ordinary one.
  EXPECT_EQ(unit.send("602#A40020007F1A0000"), "582#410020001A000000");
  EXPECT_EQ(unit.send("602#A40020007F190000"), "582#C60020001A000000");
}

// A text of 1000 bytes in blocks of both sides' choice, with losses.
TEST_F(CanopenSdo, RepeatsWhatABlockHasLost) {
  std::string text;
  for (int i = 0; i < 1000; ++i) text += static_cast<char>('a' + i % 26);
  const auto segment = [&](unsigned sequence, std::size_t begin, bool is_last) {
    std::string bytes = text.substr(begin, 7);
    bytes.resize(7);
    char digits[4];
    std::snprintf(digits, sizeof digits, "%02X", sequence | (is_last ? 0x80U : 0U));
    std::string frame = std::string("602#") + digits;
    for (const char c : bytes) {
      std::snprintf(digits, sizeof digits, "%02X", static_cast<unsigned>(c));
      frame += digits;
    }
    return frame;
  };
  EXPECT_EQ(unit.send("602#C000200000000000"), "582#A40020007F000000");
  std::size_t done = 0;
  for (unsigned block = 0; done < text.size(); ++block) {
    const unsigned lost = block == 0 ? 100 : 0;
    std::string answer;
    for (unsigned k = 1; k <= 127 && answer.empty(); ++k) {
      const std::size_t begin = done + 7 * (k - 1);
      if (k != lost) answer = unit.send(segment(k, begin, begin + 7 >= text.size()));
    }
    ASSERT_EQ(answer.substr(0, 6), "582#A2");
    done += 7 * std::stoul(answer.substr(6, 2), nullptr, 16);
    if (block == 0) {
      EXPECT_EQ(done, 99 * 7U);
    }
  }
  EXPECT_EQ(unit.send("602#C900000000000000"), "582#A100000000000000") << "1001 bytes less two, without CRC";
  EXPECT_EQ(unit.send("602#4000200000000000"), "582#41002000E7030000");

  // The upload in blocks of 50 segments, of which the client loses the last 10 once.
  unit.send("602#C400200000000000");
  EXPECT_EQ(unit.send("602#A400200032000000"), "582#A2007F0000000000") << "a segment, as a download goes on";
  unit.send("602#8000200000000000");
  EXPECT_EQ(unit.send("602#A400200032000000"), "582#C6002000E7030000");
  std::string got;
  std::string frames = unit.send("602#A300000000000000");
  frames += " " + unit.pass(10ms);
  bool is_lossy = true, is_last = false;
  while (!is_last) {
    std::istringstream words(frames);
    unsigned taken = 0, sent = 0;
    for (std::string word; words >> word; ++sent) {
      ASSERT_EQ(std::stoul(word.substr(4, 2), nullptr, 16) & 0x7F, sent + 1);
      if (is_lossy && sent >= 40) continue;
      ++taken;
      is_last = (std::stoul(word.substr(4, 2), nullptr, 16) & 0x80) != 0;
      for (std::size_t i = 6; i < 20; i += 2) got += static_cast<char>(std::stoul(word.substr(i, 2), nullptr, 16));
    }
    ASSERT_EQ(sent, is_last ? taken : 50U);
    is_lossy = false;
    char acknowledgement[24];
    std::snprintf(acknowledgement, sizeof acknowledgement, "602#A2%02X320000000000", taken);
    frames = unit.send(acknowledgement);
    if (!is_last) frames += " " + unit.pass(10ms);
  }
  EXPECT_EQ(frames.substr(0, 6), "582#C9");
  got.resize(999);
  EXPECT_EQ(got, text.substr(0, 999));
  EXPECT_EQ(unit.send("602#A100000000000000"), "");
}

TEST_F(CanopenSdo, AbortsWithTheReason) {
  EXPECT_EQ(unit.read_abort(0x1234, 0), 0x06020000U);
  EXPECT_EQ(unit.read_abort(0x1018, 5), 0x06090011U);
  EXPECT_EQ(unit.read_abort(0x1800, 4), 0x06090011U);
  EXPECT_EQ(unit.read_abort(0x2001, 0), 0x06010001U);
  EXPECT_EQ(unit.write(0x1000, 0, 1, 4), 0x06010002U);
  EXPECT_EQ(unit.write(0x1018, 0, 1, 1), 0x06010002U);
  EXPECT_EQ(unit.write(0x1234, 0, 1, 4), 0x06020000U);
  EXPECT_EQ(unit.write(0x1800, 4, 1, 1), 0x06090011U);
  EXPECT_EQ(unit.write(0x1017, 0, 1, 4), 0x06070012U);
  EXPECT_EQ(unit.write(0x1017, 0, 1, 1), 0x06070013U);
  EXPECT_EQ(unit.write(0x1019, 0, 241, 1), 0x06090031U);
  EXPECT_EQ(unit.write(0x1019, 0, 1, 1), 0x06090030U);
  EXPECT_EQ(unit.write(0x2103, 1, 0x7FC00000, 4), 0x06090030U) << "not a number";
  EXPECT_EQ(unit.count("sdo_aborts"), 13U);
  EXPECT_EQ(unit.send("602#8018100100000000"), "") << "nothing to abort";
  EXPECT_EQ(unit.count("sdo_aborts"), 13U);
  // Commands that do not exist, or belong to no transfer.
  for (const char* wrong : {"602#E018100100000000", "602#0000000000000000", "602#6000000000000000",
                            "602#A300000000000000", "602#A200000000000000", "602#C100000000000000"})
    EXPECT_EQ(unit.abort_of(unit.send(wrong)), 0x05040001U) << wrong;
  EXPECT_EQ(unit.send("602#40181001"), "") << "a request has 8 bytes";
  EXPECT_EQ(unit.send("603#4018100100000000"), "") << "another node";
}

TEST_F(CanopenSdo, AbortsSegmentedTransfers) {
  unit.send("602#4008100000000000");
  EXPECT_EQ(unit.send("602#7000000000000000"), "582#8008100000000305") << "the toggle has not alternated";
  EXPECT_EQ(unit.send("602#6000000000000000"), "582#8008100001000405") << "the transfer has ended";
  unit.send("602#2100200010000000 602#0041206C6F6E6720");
  EXPECT_EQ(unit.send("602#0041206C6F6E6720"), "582#8000200000000305");
  EXPECT_EQ(unit.send("602#2100200004000000 602#0D41000000000000"), "582#6000200000000000 582#8000200010000706")
      << "one byte of four";
  EXPECT_EQ(unit.send("602#2100200001040000"), "582#8000200012000706") << "1025 bytes";
  EXPECT_EQ(unit.send("602#2117100004000000"), "582#8017100012000706");
  unit.send("602#2000200000000000");
  std::string answer = "none yet";
  for (int k = 0; k < 200 && unit.abort_of(answer) == 0; ++k)
    answer = unit.send(k % 2 == 0 ? "602#0041414141414141" : "602#1041414141414141");
  EXPECT_EQ(answer, "582#8000200012000706") << "no end";
}

TEST_F(CanopenSdo, AbortsBlockTransfers) {
  EXPECT_EQ(unit.send("602#A400200000000000"), "582#8000200002000405") << "a block of no segment";
  EXPECT_EQ(unit.send("602#A400200080000000"), "582#8000200002000405");
  unit.send("602#C600200003000000 602#8141424300000000");
  EXPECT_EQ(unit.send("602#D100000000000000"), "582#8000200004000405") << "the CRC is wrong";
  unit.send("602#C600200003000000");
  EXPECT_EQ(unit.send("602#8000200000000000"), "") << "the client aborts";
  EXPECT_EQ(unit.send("602#C600100003000000"), "582#8000100002000106") << "read only";
  unit.send("602#A40020007F000000 602#A300000000000000");
  EXPECT_EQ(unit.send("602#A2057F0000000000"), "582#8000200003000405") << "more than was sent";
}

TEST_F(CanopenSdo, EndsATransferThatStops) {
  for (const char* begin : {"602#4008100000000000", "602#2100200010000000", "602#C600200003000000",
                            "602#A40810007F000000", "602#A40810007F000000 602#A300000000000000"}) {
    const std::uint64_t before = unit.count("sdo_aborts");
    EXPECT_NE(unit.send(begin), "");
    EXPECT_EQ(unit.pass(999ms), "");
    const std::string end = unit.pass(1ms);
    EXPECT_EQ(unit.abort_of(end), 0x05040000U) << begin << end;
    EXPECT_EQ(unit.count("sdo_aborts"), before + 1);
    EXPECT_EQ(unit.pass(10s), "");
  }
  unit.send("602#4008100000000000 000#0200");
  EXPECT_EQ(unit.pass(10s), "") << "a stopped node has no SDO";
}

// --- LSS

TEST(CanopenLss, ConfiguresANodeIdAndStoresIt) {
  Unit unit("heartbeat_ms=0 serial_number=0x12345678");
  unit.pass(0s);
  EXPECT_EQ(unit.send("7E5#1114000000000000"), "") << "it waits";
  EXPECT_EQ(unit.send("7E5#0401000000000000"), "");
  EXPECT_EQ(unit.send("7E5#5E00000000000000"), "7E4#5E0A000000000000");
  EXPECT_EQ(unit.send("7E5#5A00000000000000"), "7E4#5A00000000000000");
  EXPECT_EQ(unit.send("7E5#5B00000000000000"), "7E4#5B01000000000000");
  EXPECT_EQ(unit.send("7E5#5C00000000000000"), "7E4#5C00000100000000");
  EXPECT_EQ(unit.send("7E5#5D00000000000000"), "7E4#5D78563412000000");
  EXPECT_EQ(unit.send("7E5#1180000000000000"), "7E4#1101000000000000");
  EXPECT_EQ(unit.send("7E5#1100000000000000"), "7E4#1101000000000000");
  EXPECT_EQ(unit.send("7E5#1114000000000000"), "7E4#1100000000000000");
  EXPECT_EQ(unit.send("7E5#1300050000000000"), "7E4#1301000000000000");
  EXPECT_EQ(unit.send("7E5#1301020000000000"), "7E4#1301000000000000");
  EXPECT_EQ(unit.send("7E5#1300020000000000"), "7E4#1300000000000000");
  EXPECT_EQ(unit.send("7E5#1700000000000000"), "7E4#1700000000000000");
  EXPECT_EQ(unit.send("7E5#0400000000000000"), "");
  EXPECT_EQ(unit.read(0x2002, 1), 20U);
  EXPECT_EQ(unit.read(0x2002, 2), 2U);
  EXPECT_EQ(unit.read(0x1014), 0x8AU) << "until the next reset";
  EXPECT_EQ(unit.send("000#8200"), "714#00");
  unit.node_id = 20;
  EXPECT_EQ(unit.read(0x1014), 0x94U);
  EXPECT_EQ(unit.read(0x1200, 1), 0x614U);
  unit.device->power_on(unit.now);
  EXPECT_EQ(unit.pass(0s), "714#00");
}

// Baumer, GNAMG CANopen manual of 2012, p. 18: 1000h is 0004019Ah, "Two axis with resolution max. 32-bit".
TEST(CanopenDeviceType, IsATwoAxisInclinometer) {
  Unit unit, of_16_bits("device_type=0x2019A");
  unit.pass(0s);
  of_16_bits.pass(0s);
  EXPECT_EQ(unit.read(0x1000), 0x4019AU);
  EXPECT_EQ(of_16_bits.read(0x1000), 0x2019AU);
}

TEST(CanopenLss, SelectsBySerialNumber) {
  Unit unit("vendor_id=1 product_code=2 revision_number=3 serial_number=4");
  unit.pass(0s);
  const std::string first = "7E5#4001000000000000 7E5#4102000000000000 7E5#4203000000000000 ";
  EXPECT_EQ(unit.send(first + "7E5#4305000000000000"), "");
  EXPECT_EQ(unit.send("7E5#4304000000000000"), "") << "one of the numbers was wrong";
  EXPECT_EQ(unit.send(first + "7E5#4304000000000000"), "7E4#4400000000000000");
  EXPECT_EQ(unit.send("7E5#5E00000000000000"), "7E4#5E0A000000000000");
  const std::string range = "7E5#4601000000000000 7E5#4702000000000000 7E5#4803000000000000 7E5#4907000000000000 ";
  EXPECT_EQ(unit.send(range + "7E5#4A00000000000000 7E5#4B04000000000000"), "7E4#4F00000000000000");
  EXPECT_EQ(unit.send(range + "7E5#4A05000000000000 7E5#4B09000000000000"), "");
}

// The scan of python-canopen's LssMaster.fast_scan().
TEST(CanopenLss, AnUnconfiguredUnitIsFoundAndBoots) {
  Unit unit("node_id=255 vendor_id=0x89ABCDEF product_code=0 revision_number=0xFFFFFFFF serial_number=77");
  EXPECT_EQ(unit.pass(10s), "");
  EXPECT_EQ(unit.send("000#0100 000#8100 7E5#4C00000000000000"), "7E4#5000000000000000");
  const auto scan = [&](std::uint32_t number, unsigned bit, unsigned sub, unsigned next) {
    char text[40];
    std::snprintf(text, sizeof text, "7E5#51%02X%02X%02X%02X%02X%02X%02X", number & 0xFFU, number >> 8 & 0xFFU,
                  number >> 16 & 0xFFU, number >> 24, bit, sub, next);
    const std::string answer = unit.send(text);
    EXPECT_TRUE(answer.empty() || answer == "7E4#4F00000000000000") << answer;
    return !answer.empty();
  };
  std::uint32_t found[4] = {};
  ASSERT_TRUE(scan(0, 0x80, 0, 0));
  unsigned next = 0;
  for (unsigned sub = 0; sub < 4; ++sub) {
    for (unsigned bit = 32; bit-- > 0;)
      if (!scan(found[sub], bit, sub, next)) found[sub] |= 1U << bit;
    next = (sub + 1) % 4;
    ASSERT_TRUE(scan(found[sub], 0, sub, next));
  }
  EXPECT_EQ(found[0], 0x89ABCDEFU);
  EXPECT_EQ(found[1], 0U);
  EXPECT_EQ(found[2], 0xFFFFFFFFU);
  EXPECT_EQ(found[3], 77U);
  EXPECT_EQ(unit.send("7E5#1115000000000000"), "7E4#1100000000000000") << "it is selected";
  EXPECT_EQ(unit.send("7E5#0400000000000000"), "715#00");
  unit.node_id = 21;
  EXPECT_EQ(unit.read(0x1018, 4), 77U);
  EXPECT_EQ(unit.send("7E5#4C00000000000000"), "");
  unit.device->power_on(unit.now);
  EXPECT_EQ(unit.pass(10s), "") << "it was not stored";
}

// CiA 301 leaves the time-out to the device; it is that of a pause, not of the transfer.
TEST(CanopenSdoTime, ATransferMayTakeLongerThanAPauseInIt) {
  Unit unit("node_id=2");
  unit.node_id = 2;
  unit.pass(0s);
  EXPECT_EQ(unit.send("602#2100200000000000"), "582#6000200000000000");
  for (unsigned k = 0; k < 8; ++k) {
    EXPECT_EQ(unit.pass(900ms).find("582#80"), std::string::npos) << k;
    EXPECT_EQ(unit.send(k % 2 == 0 ? "602#0031323334353637" : "602#1031323334353637").substr(0, 5),
              k % 2 == 0 ? "582#2" : "582#3");
  }
  EXPECT_EQ(unit.count("sdo_aborts"), 0U);
  EXPECT_NE(unit.pass(5s).find("582#8000200000000405"), std::string::npos) << "the pause is too long";
  // The upload likewise, segment by segment.
  EXPECT_EQ(unit.send("602#210020000D000000 602#0041206C6F6E6720 602#13737472696E6700"),
            "582#6000200000000000 582#2000000000000000 582#3000000000000000");
  EXPECT_EQ(unit.send("602#4000200000000000"), "582#410020000D000000");
  EXPECT_EQ(unit.pass(900ms).find("582#"), std::string::npos);
  EXPECT_EQ(unit.send("602#6000000000000000"), "582#0041206C6F6E6720");
  EXPECT_EQ(unit.pass(900ms).find("582#"), std::string::npos);
  EXPECT_EQ(unit.send("602#7000000000000000"), "582#13737472696E6700");
}

}  // namespace
}  // namespace imud
