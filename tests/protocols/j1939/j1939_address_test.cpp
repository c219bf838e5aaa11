// Address claim of the J1939 unit: SAE J1939-81.
#include "tests/protocols/j1939/j1939_unit.hpp"

namespace imud::j1939_test {
namespace {

const std::string claim = "18EEFF80#0100E06600830080";  // with own_name
const std::string lower = "0000E06600830080", higher = "0200E06600830080";

TEST(J1939AddressTest, ClaimsAtPowerOnAndWaits) {
  Unit unit;
  EXPECT_EQ(unit.pass(0ms), Texts{claim});
  EXPECT_TRUE(unit.sample().empty());
  EXPECT_TRUE(unit.give("18EA8000#2AF000").empty()) << "a request for data, before the address is its own";
  EXPECT_TRUE(unit.pass(249ms).empty());
  EXPECT_TRUE(unit.sample().empty());
  EXPECT_TRUE(unit.pass(1ms).empty());
  EXPECT_EQ(unit.sample().size(), 3U);
  EXPECT_TRUE(unit.pass(10s).empty()) << "claims are not repeated";
}

TEST(J1939AddressTest, BuildsTheNameOfItsFields) {
  Unit unit(
      "name_identity=0x123456 name_manufacturer=0x2AA name_ecu_instance=5 name_function_instance=0x15 "
      "name_function=0x3C name_vehicle_system=0x55 name_vehicle_system_instance=9 name_industry_group=2 "
      "name_arbitrary_address=false source_address=7");
  // 0x123456 | 0x2AA << 21 = 0x55523456; 5 | 0x15 << 3 = 0xAD; 0x55 << 1 = 0xAA; 9 | 2 << 4 = 0x29.
  EXPECT_EQ(unit.pass(0ms), Texts{"18EEFF07#56345255AD3CAA29"});
}

TEST(J1939AddressTest, RepeatsItsClaim) {
  Unit unit("claim_period_ms=1000");
  EXPECT_EQ(count_of(unit.run(5s), claim), 6U);
  EXPECT_EQ(count_of(Unit().run(5s), claim), 1U);
  EXPECT_EQ(count_of(Unit("model=openimu300ri").run(5s), claim), 6U) << "as its firmware is delivered";
  EXPECT_EQ(count_of(Unit("model=openimu300ri claim_period_ms=0").run(5s), claim), 1U);
}

TEST(J1939AddressTest, DefendsItsAddressAgainstAHigherName) {
  Claimed unit;
  EXPECT_EQ(unit.give("18EEFF80#" + higher), Texts{claim});
  EXPECT_EQ(unit.sample().size(), 3U) << "it goes on sending";
  EXPECT_EQ(unit.count("address_conflicts"), 1U);
  EXPECT_EQ(unit.count("address_changes"), 0U);
}

TEST(J1939AddressTest, MovesToTheNextFreeAddress) {
  Claimed unit;
  unit.give("18EEFF81#" + lower);  // 0x81 is taken; 0x82 too, by a node that only sends data
  unit.give("18FEF682#00");
  EXPECT_EQ(unit.give("18EEFF80#" + lower), Texts{"18EEFF83#" + own_name});
  EXPECT_TRUE(unit.sample().empty()) << "it waits again";
  unit.pass(250ms);
  EXPECT_EQ(count_of(unit.sample(), "0CF02A83#"), 1U);
  EXPECT_EQ(unit.count("address_changes"), 1U);
  // It comes back with that address, as the firmware does.
  unit.device->power_on(unit.now);
  EXPECT_EQ(unit.pass(0ms), Texts{"18EEFF83#" + own_name});
}

TEST(J1939AddressTest, MovesOnceAroundThePool) {
  Claimed unit("source_address=247");
  EXPECT_EQ(unit.give("18EEFFF7#" + lower), Texts{"18EEFF80#" + own_name});
  // 118 more addresses; then all are taken.
  unsigned address = 0x80;
  for (int i = 0; i < 118; ++i, ++address) {
    char text[32];
    std::snprintf(text, sizeof text, "18EEFF%02X#", address);
    const Texts answers = unit.give(text + lower);
    std::snprintf(text, sizeof text, "18EEFF%02X#", address + 1);
    ASSERT_EQ(answers, Texts{text + own_name});
  }
  ASSERT_EQ(address, 246U);
  EXPECT_TRUE(unit.give("18EEFFF6#" + lower).empty());
  EXPECT_EQ(unit.pass(153ms), Texts{"18EEFFFE#" + own_name}) << "it cannot claim an address";
}

TEST(J1939AddressTest, FallsSilentWithoutTheArbitraryAddressBit) {
  Claimed unit("name_arbitrary_address=false");
  const std::string name = "0100E06600830000";
  EXPECT_TRUE(unit.give("18EEFF80#" + lower.substr(0, 14) + "00").empty());
  EXPECT_TRUE(unit.pass(1100us).empty()) << "the delay of (1 + identity mod 256) * 0.6 ms";
  EXPECT_EQ(unit.pass(100us), Texts{"18EEFFFE#" + name});
  EXPECT_TRUE(unit.run(2s).empty());
  EXPECT_TRUE(unit.give("18EA8000#2AF000 18FF5500#8002 18EAFE00#2AF000").empty());
  // It still answers requests for claims, and can be given an address.
  EXPECT_TRUE(unit.give("18EAFF00#00EE00").empty());
  EXPECT_EQ(unit.pass(153ms), Texts{"18EEFFFE#" + name});
  EXPECT_EQ(unit.give("1CECFF00#20090002FFD8FE00 1CEBFF00#010100E066008300 1CEBFF00#020090FFFFFFFFFF"),
            Texts{"18EEFF90#" + name});
  unit.pass(250ms);
  EXPECT_EQ(unit.sample().size(), 3U);
}

TEST(J1939AddressTest, ReportsItsLossAtOnceWhateverItsPeriod) {
  Claimed unit("name_arbitrary_address=false claim_period_ms=60000");
  EXPECT_TRUE(unit.give("18EEFF80#0000000000000000").empty());
  EXPECT_EQ(unit.pass(1200us), Texts{"18EEFFFE#0100E06600830000"});
  EXPECT_TRUE(unit.pass(100s).empty());
}

TEST(J1939AddressTest, MovesIfTheNamesAreEqual) {
  Claimed unit;
  EXPECT_EQ(unit.give(claim), Texts{"18EEFF81#" + own_name});
}

TEST(J1939AddressTest, NoticesOtherNodesWithItsAddress) {
  Claimed unit;
  EXPECT_TRUE(unit.give("0CF02A80#807D007C807E4004 18FEF680#0102 18FEF681#0102 18FEF6FE#0102").empty());
  EXPECT_EQ(unit.count("address_conflicts"), 2U);
  EXPECT_FALSE(unit.protocol.counters[0].warning.empty());
}

TEST(J1939AddressTest, AnswersRequestsForClaims) {
  Unit unit;
  unit.pass(10ms);
  EXPECT_EQ(unit.give("18EAFF00#00EE00"), Texts{claim}) << "while it waits";
  EXPECT_EQ(unit.give("18EA8000#00EE00"), Texts{claim});
  EXPECT_TRUE(unit.give("18EA8100#00EE00").empty()) << "for another node";
  EXPECT_EQ(unit.give("18EAFFFE#00EE00"), Texts{claim}) << "from a node without address";
}

TEST(J1939AddressTest, TakesACommandedAddressByItsName) {
  Claimed unit;
  const std::string data = " 1CEBFF00#010100E066008300 1CEBFF00#028093FFFFFFFFFF";
  EXPECT_TRUE(unit.give("1CECFF00#20090002FFD8FE00 1CEBFF00#010200E066008300 1CEBFF00#028093FFFFFFFFFF").empty())
      << "another NAME";
  EXPECT_EQ(unit.give("1CECFF00#20090002FFD8FE00" + data), Texts{"18EEFF93#" + own_name});
  EXPECT_TRUE(unit.sample().empty());
  unit.pass(250ms);
  EXPECT_EQ(count_of(unit.sample(), "0CF02A93#"), 1U);
  EXPECT_TRUE(unit.give("1CECFF00#20090002FFD8FE00 1CEBFF00#010100E066008300 1CEBFF00#0280FEFFFFFFFFFF").empty())
      << "no address";
}

TEST(J1939AddressTest, StepsOfTheClockChangeNothing) {
  Unit unit("claim_period_ms=400"), stepped("claim_period_ms=400");
  const auto both = [&](Nanoseconds time) {
    EXPECT_EQ(unit.pass(time), stepped.pass(time));
    EXPECT_EQ(unit.sample(), stepped.sample());
    stepped.device->step_clock(-3s);
    stepped.now = stepped.now - 3s;
  };
  for (int i = 0; i < 100; ++i) {
    both(37ms);
    std::string text;
    if (i == 3) text = "18EEFF80#" + lower;
    if (i % 25 == 13) text = "1CECFF00#20090002FFD8FE00 18DFFF00#3FFFFFFFFFFFFFFF";  // BAM without data, DM13
    EXPECT_EQ(unit.give(text), stepped.give(text));
  }
  EXPECT_EQ(unit.count("transfers_timed_out"), 3U);
  EXPECT_EQ(stepped.count("transfers_timed_out"), 3U);
}

}  // namespace
}  // namespace imud::j1939_test
