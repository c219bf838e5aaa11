// Requests to the J1939 unit, its acknowledgements, and the settings that a host makes.
#include "tests/protocols/j1939/j1939_unit.hpp"

namespace imud::j1939_test {
namespace {

TEST(J1939RequestTest, AnswersWithTheNewestSample) {
  Claimed unit("packet_rate=0 packet_types=accs");
  Sample sample;
  sample.specific_force.x() = 1;
  EXPECT_TRUE(unit.sample(sample).empty());
  unit.pass(3ms);
  // One message, once; the latency is the age of the sample, 3 ms.
  EXPECT_EQ(unit.give("18EAFF00#2DF000"), Texts{"08F02D80#647D007D007D8006"});
  EXPECT_EQ(unit.give("18EA8000#2AF000"), Texts{"0CF02A80#007D007D007D4006"})
      << "a message that is not sent otherwise";
  EXPECT_EQ(unit.give("18EA8000#6DFF00").size(), 1U);
  unit.pass(1s);
  EXPECT_EQ(unit.give("18EAFF00#2DF000"), Texts{"08F02D80#647D007D007D80FA"}) << "125 ms at most";
  EXPECT_EQ(unit.count("requests_refused"), 0U);
}

TEST(J1939RequestTest, AcceptsBothByteOrders) {
  const auto answers = [](const char* order, const char* text) {
    Claimed unit(std::string("request_byte_order=") + order);
    return unit.give(text);
  };
  const Texts ari = {"0CF02A80#007D007D007D4000"}, refused = {"18E8FF80#01FFFFFF002AF000"};
  EXPECT_EQ(answers("auto", "18EA8000#2AF000"), ari);
  EXPECT_EQ(answers("auto", "18EA8000#00F02A"), ari);
  EXPECT_EQ(answers("j1939", "18EA8000#2AF000"), ari);
  EXPECT_EQ(answers("j1939", "18EA8000#00F02A"), Texts{"18E8FF80#01FFFFFF0000F02A"});
  EXPECT_EQ(answers("swapped", "18EA8000#00F02A"), ari);
  EXPECT_EQ(answers("swapped", "18EA8000#2AF000").size(), 1U);
  EXPECT_EQ(answers("swapped", "18EA8000#2AF000")[0].substr(0, 11), "18E8FF80#01");
  // Bit 9 of the user behavior does the same.
  Claimed unit("request_byte_order=j1939");
  unit.give("18FF5900#8000020000FF");
  EXPECT_EQ(unit.give("18EA8000#00F02A"), ari);
}

TEST(J1939RequestTest, RefusesOnlyWhatItAloneIsAskedFor) {
  Claimed unit;
  EXPECT_EQ(unit.give("18EA8042#EBFE00"), Texts{"18E8FF80#01FFFFFF42EBFE00"});
  EXPECT_TRUE(unit.give("18EAFF42#EBFE00 18EA8142#EBFE00 18EA8042#EBFE 18EA8042#EBFE0000 18EA8042#R").empty());
  EXPECT_EQ(unit.count("requests_refused"), 1U);
  // Messages of the other model.
  EXPECT_EQ(unit.give("18EA8042#6AFF00"), Texts{"18E8FF80#01FFFFFF426AFF00"});
  Unit fresh("claim_wait_ms=0");
  EXPECT_EQ(fresh.give("18EA8042#2AF000"), Texts{"18E8FF80#03FFFFFF422AF000"}) << "no sample yet: it cannot respond";
}

TEST(J1939RequestTest, IdentifiesItselfAsTheFirmwareDoes) {
  Claimed unit;
  EXPECT_EQ(unit.give("18EAFF00#C5FD00"), Texts{"18FDC580#" + own_name});
  EXPECT_EQ(unit.give("18EAFF00#DAFE00"), Texts{"18FEDA80#0100050000AAAAAA"});
  Claimed other("model=openimu300ri");
  EXPECT_EQ(other.give("18EAFF00#DAFE00"), Texts{"18FEDA80#0100050000"}) << "it does not pad";
}

TEST(J1939RequestTest, RefusesAccessToItsMemory) {
  Claimed unit;
  EXPECT_EQ(unit.give("18D98042#10DF0000000807FF"), Texts{"18D84280#000B16000006FFFF"});
  EXPECT_TRUE(unit.give("18D98142#10DF0000000807FF").empty());
}

// Byte 1, the group function value, is not applicable, and so FF: SAE J1939-21, 5.4.4, as AgIsoStack++ has it
// (can_parameter_group_number_request_protocol.cpp, send_acknowledgement()).
const Texts accepted(std::string extension) { return {"18E8FF80#00FFFFFF42" + extension + "FF00"}; }
const Texts refused(std::string extension) { return {"18E8FF80#01FFFFFF42" + extension + "FF00"}; }

struct SettingCase {
  const char* set;
  const char* extension;
  const char* request;
  const char* report;  // afterwards
};

TEST(J1939SettingTest, AreKeptAndReported) {
  const SettingCase cases[] = {
      {"18FF5542#8005", "55", "18EA8042#55FF00", "18FF5580#4205AAAAAAAAAAAA"},
      {"18FF5642#803F00", "56", "18EA8042#56FF00", "18FF5680#423F003BAAAAAAAA"},
      {"18FF5742#800532", "57", "18EA8042#57FF00", "18FF5780#420532AAAAAAAAAA"},
      {"18FF5842#80016C", "58", "18EA8042#58FF00", "18FF5880#42016CAAAAAAAAAA"},
      {"18FF5942#8048808000FF", "59", "18EA8042#59FF00", "18FF5980#424A80AAAAAAAAAA"},
      {"18FF5B42#80FF010203040506", "5B", "18EA8042#5BFF00", "18FF5B80#42FF010203040506"},
  };
  for (const SettingCase& one : cases) {
    Claimed unit;
    EXPECT_EQ(unit.give(one.set), accepted(one.extension)) << one.set;
    EXPECT_EQ(unit.give(one.request), Texts{one.report}) << one.set;
    // They last until the power goes off, and longer if they are saved.
    unit.device->power_on(unit.now);
    unit.pass(250ms);
    EXPECT_NE(unit.give(one.request), Texts{one.report}) << one.set;
    unit.give(one.set);
    EXPECT_EQ(unit.give("18FF5142#0080"), Texts{"18FF5180#014201AAAAAAAAAA"});
    unit.device->power_on(unit.now);
    unit.pass(250ms);
    EXPECT_EQ(unit.give(one.request), Texts{one.report}) << one.set;
  }
}

TEST(J1939SettingTest, HaveEffect) {
  Claimed unit;
  unit.give("18FF5542#800A");
  EXPECT_EQ(count_of(unit.run(1s), "08F02D80#"), 10U);
  unit.give("18FF5542#8001 18FF5642#80040008FF");  // only ACCS; priorities: ari 0, accs 2, ssi2 0
  EXPECT_EQ(count_of(unit.sample(), "08F02D80#"), 1U);
  unit.give("18FF5642#8007000CFF");
  EXPECT_EQ(count_of(unit.sample(), "0CF02D80#"), 1U);
  Sample sample;
  sample.specific_force = {1, 2, 3};
  unit.give("18FF5642#80040008FF 18FF5842#800048");
  EXPECT_EQ(unit.sample(sample), Texts{"08F02D80#647D387CD47B8000"});
  unit.give("18FF5842#800000 18FF5942#8048000000FF");
  EXPECT_EQ(unit.sample(sample), Texts{"08F02D80#387C647DD47B8000"});
}

TEST(J1939SettingTest, FiltersAreThoseOfTheSensors) {
  Claimed unit;
  const auto cut_off = [&unit](auto sensor) { return ((*unit.device->filters()).*sensor).cut_off_hz; };
  EXPECT_EQ(cut_off(&SensorFilters::gyro), Vector3::Constant(25));
  EXPECT_EQ(cut_off(&SensorFilters::accelerometer), Vector3::Constant(25));
  unit.give("18FF5742#80050A");
  EXPECT_EQ(cut_off(&SensorFilters::gyro), Vector3::Constant(5));
  EXPECT_EQ(cut_off(&SensorFilters::accelerometer), Vector3::Constant(10));
  unit.give("18FF5742#800032");  // none, and 50 Hz, which is half of the sample rate
  EXPECT_FALSE(unit.device->filters()->gyro.is_on());
  EXPECT_FALSE(unit.device->filters()->accelerometer.is_on());
}

TEST(J1939SettingTest, AreRefusedIfTheProductHasNone) {
  Claimed unit;
  for (const char* one : {"5542#8003", "5642#804000", "5742#800301", "5842#800001", "5842#800200", "5942#8000",
                          "5B42#80FF", "5A42#80000000", "5F42#8000", "6042#8000", "F242#8041"}) {
    const std::string extension(one, 2);
    EXPECT_EQ(unit.give("18FF" + std::string(one)), refused(extension)) << one;
  }
  EXPECT_EQ(unit.count("requests_refused"), 11U);
  // For others; messages of any manufacturer; reports of other units.
  EXPECT_TRUE(unit.give("18FF5542#8105 18FF7142#8005 18FF5542#80 18FF5442#8005 18FF6B42#8005 18FF5142#0180").empty());
  EXPECT_EQ(unit.sample().size(), 3U);
}

TEST(J1939SettingTest, AreAcknowledgedIfConfigured) {
  Claimed unit("acknowledge_settings=false");
  EXPECT_TRUE(unit.give("18FF5542#8005").empty());
  EXPECT_EQ(unit.give("18FF5542#8003"), refused("55"));
  EXPECT_EQ(unit.give("18EA8042#55FF00"), Texts{"18FF5580#4205AAAAAAAAAAAA"});
}

TEST(J1939SettingTest, MoveByBanks) {
  Claimed unit;
  EXPECT_EQ(unit.give("18FFF142#8041FF7F00FFFF00"), accepted("F1"));  // the packet rate to 0x41; 0x7F is beyond 0x6C
  EXPECT_TRUE(unit.give("18FF5542#8005").empty());
  EXPECT_EQ(unit.give("18FF4142#8005"), accepted("41"));
  EXPECT_EQ(unit.give("18EA8042#41FF00"), Texts{"18FF4180#4205AAAAAAAAAAAA"});
  EXPECT_EQ(unit.give("18EA8042#55FF00"), refused("55"));
  EXPECT_EQ(unit.give("18EA8042#57FF00").at(0).substr(0, 8), "18FF5780");
  EXPECT_EQ(unit.give("18FFF042#80FFFFFFFFFF4042"), accepted("F0"));
  EXPECT_EQ(unit.give("18EA8042#40FF00").at(0).substr(0, 8), "0CFF4080");
  EXPECT_EQ(unit.give("18EA8042#42FF00").at(0).substr(0, 8), "08FF4280");
  // The OpenIMU300RI may use extensions up to 0x7F.
  Claimed other("model=openimu300ri");
  EXPECT_EQ(other.give("18FFF142#807F"), accepted("F1"));
  EXPECT_EQ(other.give("18FF7F42#8005"), accepted("7F"));
}

TEST(J1939SettingTest, ARestartClaimsTheSavedAddress) {
  Claimed unit;
  unit.give("18FF5942#800000000091");  // the address 0x91
  EXPECT_EQ(unit.sample().size(), 3U);
  EXPECT_EQ(unit.give("18FF5142#0280").size(), 1U);
  EXPECT_TRUE(unit.pass(49ms).empty());
  EXPECT_EQ(unit.pass(1ms), Texts{"18EEFF91#" + own_name});
  // A reset without saving.
  unit.pass(250ms);
  unit.give("18FF5542#9105");
  EXPECT_EQ(unit.give("18FF5042#0291"), Texts{"18FF5091#014201AAAAAAAAAA"});
  unit.pass(300ms);
  EXPECT_EQ(unit.give("18EA9142#55FF00"), Texts{"18FF5591#4201AAAAAAAAAAAA"});
}

TEST(J1939SettingTest, Dm13PausesTheOutput) {
  Claimed unit("packet_types=ari");
  EXPECT_EQ(unit.run(1s).size(), 100U);
  unit.give("18DFFF42#3FFFFFFFFFFFFFFF");
  EXPECT_TRUE(unit.run(5900ms).empty());
  EXPECT_EQ(unit.give("18EA8042#2AF000").size(), 1U) << "requests are answered";
  EXPECT_GE(unit.run(1s).size(), 85U) << "for 6 s";
  unit.give("18DFFF42#3FFFFFFFFFFFFFFF");
  unit.run(5s);
  unit.give("18DFFF42#FFFFFF0FFFFFFFFF");  // hold
  EXPECT_TRUE(unit.run(5s).empty());
  unit.give("18DFFF42#7FFFFFFFFFFFFFFF");
  EXPECT_EQ(unit.run(1s).size(), 100U);
  EXPECT_EQ((unit.give("18DFFF42#BFFFFFFFFFFFFFFF 18DF8142#3FFFFFFFFFFFFFFF"), unit.run(1s).size()), 100U)
      << "networks of others, other nodes";
}

TEST(J1939SettingTest, ABitThatIsSetAndClearedIsCleared) {
  Claimed unit;
  unit.give("18FF5942#8048808000FF");
  EXPECT_EQ(unit.give("18EA8042#59FF00"), Texts{"18FF5980#424A80AAAAAAAAAA"});
  unit.give("18FF5942#8048804800FF");
  EXPECT_EQ(unit.give("18EA8042#59FF00"), Texts{"18FF5980#420280AAAAAAAAAA"});
}

TEST(J1939SettingTest, PacketTypesMayEndAfterEachPart) {
  struct {
    const char* command;
    std::string sent;
  } const cases[] = {
      {"18FF5642#8004", "08F02D80"},        // the low byte of the types
      {"18FF5642#800400", "08F02D80"},      // the whole
      {"18FF5642#8004000C", "08F02D80"},    // priorities without the mask of those that change
      {"18FF5642#8004000CFF", "0CF02D80"},  // with it
  };
  for (const auto& [text, sent] : cases) {
    Claimed unit;
    unit.give(text);
    const Texts frames = unit.sample();
    ASSERT_EQ(frames.size(), 1U) << text;
    EXPECT_EQ(frames[0].substr(0, 8), sent) << text;
  }
}

// DM13, hold signal: 0 all devices, 1 devices that were told to stop; 15 no information.
TEST(J1939SettingTest, Dm13HoldsWhatIsPaused) {
  for (const auto& [hold, holds] : {std::pair("0F", true), {"1F", true}, {"2F", false}, {"FF", false}}) {
    Claimed unit("packet_types=ari");
    unit.give("18DFFF42#3FFFFFFFFFFFFFFF");
    unit.run(5s);
    unit.give(std::string("18DFFF42#FFFFFF") + hold + "FFFFFFFF");
    EXPECT_EQ(unit.run(5s).empty(), holds) << hold;
    Claimed running("packet_types=ari");
    running.give(std::string("18DFFF42#FFFFFF") + hold + "FFFFFFFF");
    EXPECT_FALSE(running.run(1s).empty()) << "nothing to hold";
  }
}

}  // namespace
}  // namespace imud::j1939_test
