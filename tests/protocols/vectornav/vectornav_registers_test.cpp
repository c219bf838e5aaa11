// VectorNav's registers as clients read and write them: vnproglib 1.2 and the VectorNav SDK 0.99
// (dotysan/vectornav-sdk).
#include <gtest/gtest.h>

#include <algorithm>
#include <stdexcept>
#include <tuple>

#include "protocols/vectornav/vectornav.hpp"
#include "tests/protocols/recording.hpp"
#include "tests/protocols/vectornav/vectornav_unit.hpp"

namespace imud {
namespace {

using namespace vectornav_test;

// The SDK's RegisterScan reads port 1, 2, 3, ... up to the first error; its Sensor::changeBaudRate reads "?" to learn
// which port it is connected to.
TEST(VectorNavRegisters, SerialPortsAreReadByNumber) {
  Unit unit;
  EXPECT_EQ(unit.ask("VNRRG,05"), with_xor("VNRRG,05,115200"));
  EXPECT_EQ(unit.ask("VNRRG,05,1"), with_xor("VNRRG,05,115200,1"));
  EXPECT_EQ(unit.ask("VNRRG,05,2"), with_xor("VNRRG,05,115200,2"));
  EXPECT_EQ(unit.ask("VNRRG,05,?"), with_xor("VNRRG,05,115200,1"));
  EXPECT_EQ(unit.ask("VNRRG,05,0"), with_xor("VNRRG,05,115200,1"));
  for (const char* id : {"05", "06", "07"})
    EXPECT_EQ(unit.ask("VNRRG," + std::string(id) + ",3"), with_xor("VNERR,07"));
}

TEST(VectorNavRegisters, TheOtherPortKeepsItsOwn) {
  Unit unit;
  for (const char* body : {"VNWRG,05,921600,2", "VNWRG,06,0,2", "VNWRG,07,10,2"})
    EXPECT_EQ(unit.ask(body), with_xor(body));
  EXPECT_EQ(unit.ask("VNRRG,05,2"), with_xor("VNRRG,05,921600,2"));
  EXPECT_EQ(unit.ask("VNRRG,06,2"), with_xor("VNRRG,06,0,2"));
  EXPECT_EQ(unit.ask("VNRRG,07,2"), with_xor("VNRRG,07,10,2"));
  EXPECT_EQ(unit.device->uart().baud, 115200U);
  EXPECT_EQ(unit.run(800).size(), 40U);
  EXPECT_EQ(unit.ask("VNWRG,07,20,1"), with_xor("VNWRG,07,20,1"));
  EXPECT_EQ(unit.ask("VNWRG,05,57600,?"), with_xor("VNWRG,05,57600,?"));
  EXPECT_EQ(unit.device->uart().baud, 57600U);
  EXPECT_EQ(unit.run(800).size(), 20U);
  EXPECT_EQ(unit.ask("VNWRG,07,20,3"), with_xor("VNERR,07"));
}

// RegisterScan writes back what it has read, and ends at every error except 8 and 9.
TEST(VectorNavRegisters, AreWrittenAsTheyAreRead) {
  for (const auto& [model, firmware] : {std::pair{"vn-100", "2.1.0.0"},
                                        {"vn-200", "2.1.0.0"},
                                        {"vn-300", "2.1.0.0"},
                                        {"vn-100", "3.1.0.0"},
                                        {"vn-300", "3.1.0.0"}}) {
    Unit unit({{"model", std::string(model)}, {"firmware", std::string(firmware)}});
    int accepted = 0;
    for (int id = 0; id < 256; ++id) {
      const std::string answer = unit.ask("VNRRG," + std::to_string(id));
      ASSERT_FALSE(answer.empty());
      if (answer.starts_with("$VNERR")) {
        EXPECT_EQ(answer, with_xor("VNERR,08")) << id;
        continue;
      }
      const std::string body = "VNWRG" + answer.substr(6, answer.find('*') - 6), echo = unit.ask(body);
      EXPECT_TRUE(echo == with_xor(body) || echo == with_xor("VNERR,09")) << model << ": " << body << " -> " << echo;
      accepted += echo == with_xor(body);
    }
    EXPECT_GE(accepted, 24) << model;
  }
}

TEST(VectorNavRegisters, AnOutputNeedsNoDivisor) {
  Unit unit;
  EXPECT_EQ(unit.ask("VNRRG,75"), with_xor("VNRRG,75,0,0,00"));
  EXPECT_EQ(unit.ask("VNWRG,75,0,0,00"), with_xor("VNWRG,75,0,0,00"));
  EXPECT_EQ(unit.ask("VNWRG,75,1,0,01,0001"), with_xor("VNWRG,75,1,0,01,0001"));
}

// UM004, page 23, table 20: 12, the baud is too low for what is asked for; 2, the input buffer of 256 characters
// overflowed.
TEST(VectorNavRegisters, AreRefusedForMoreThanTheLineCarries) {
  Unit unit;
  const std::string refused = with_xor("VNERR,0C");
  EXPECT_EQ(unit.ask("VNWRG,05,9600"), refused) << "40 VNYMR of 122 bytes are 48800 bit/s";
  EXPECT_EQ(unit.ask("VNRRG,05"), with_xor("VNRRG,05,115200"));
  EXPECT_EQ(unit.device->uart().baud, 115200U);
  EXPECT_EQ(unit.ask("VNWRG,05,38400"), refused);
  EXPECT_EQ(unit.ask("VNWRG,07,100"), refused);
  EXPECT_EQ(unit.ask("VNRRG,07"), with_xor("VNRRG,07,40"));
  EXPECT_EQ(unit.ask("VNWRG,75,1,8,01,0FFF"), refused);
  EXPECT_EQ(unit.ask("VNRRG,75"), with_xor("VNRRG,75,0,0,00"));
  EXPECT_EQ(unit.ask("VNWRG,75,2,8,01,0FFF"), with_xor("VNWRG,75,2,8,01,0FFF")) << "at the other port";
  EXPECT_EQ(unit.ask("VNWRG,05,9600,2"), with_xor("VNWRG,05,9600,2"));
  EXPECT_EQ(unit.ask("VNWRG,06,0"), with_xor("VNWRG,06,0"));
  EXPECT_EQ(unit.ask("VNWRG,05,9600"), with_xor("VNWRG,05,9600"));
  EXPECT_EQ(unit.ask("VNWRG,06,14"), refused);
}
TEST(VectorNavRegisters, ALowerLoadIsAcceptedAtAnyLoad) {
  Unit unit({{"binary_1", std::string("1,1,01,0FFF")}});  // 1.3 Mbit/s
  EXPECT_EQ(unit.ask("VNWRG,07,50"), with_xor("VNERR,0C"));
  EXPECT_EQ(unit.ask("VNWRG,06,0"), with_xor("VNWRG,06,0"));
  EXPECT_EQ(unit.ask("VNWRG,05,921600"), with_xor("VNWRG,05,921600"));
}

TEST(VectorNavRegisters, ALineLongerThanTheInputBufferIsAnError) {
  Unit unit;
  EXPECT_EQ(unit.send("$VNWRG,00," + std::string(300, 'x') + "\r\n"), with_xor("VNERR,02"));
  EXPECT_EQ(unit.ask("VNRRG,07"), with_xor("VNRRG,07,40"));
}

// The load of the line is computed from these sizes.
TEST(VectorNavRegisters, MessagesAreAsLongAsTheirLoad) {
  for (const unsigned type :
       {1U, 2U, 8U, 10U, 11U, 12U, 13U, 14U, 16U, 17U, 19U, 20U, 21U, 22U, 23U, 28U, 29U, 30U, 32U, 33U, 34U}) {
    Unit unit(
        {{"model", std::string("vn-300")}, {"firmware", std::string("3.1.0.0")}, {"async_type", std::int64_t{type}}});
    for (const bool is_placed : {false, true}) {
      unit.sample.navigation.is_known = is_placed;
      unit.sample.rate = {-30, 30, 0};
      EXPECT_EQ(unit.run(400).at(1).size(), vectornav::size_of(type)) << type;
    }
  }
}

// The SDK's enumerations of registers 30 and 35; a tag of 20 characters.
TEST(VectorNavRegisters, RefuseWhatIsOutOfRange) {
  Unit unit;
  for (const char* body : {"VNWRG,30,9,0,0,0,1,0,1", "VNWRG,30,0,7,0,0,1,0,1", "VNWRG,30,0,0,0,0,4,0,1",
                           "VNWRG,30,0,0,0,0,1,0,3", "VNWRG,30,-1,0,0,0,1,0,1", "VNWRG,35,2,1,1,1",
                           "VNWRG,35,1,3,1,1", "VNWRG,35,1,1,1,-1", "VNWRG,00,123456789012345678901"}) {
    EXPECT_EQ(unit.ask(body), with_xor("VNERR,07")) << body;
  }
  for (const char* body : {"VNWRG,30,5,6,5,6,3,3,2", "VNWRG,35,1,2,1,1", "VNWRG,00,12345678901234567890"})
    EXPECT_EQ(unit.ask(body), with_xor(body));
}

TEST(VectorNavRegisters, NoCalibrationMakesWhatIsNoNumber) {
  Unit unit;
  for (const char* id : {"23", "25", "84"}) {
    EXPECT_EQ(unit.ask("VNWRG," + std::string(id) + ",1e300,0,0,0,1e300,0,0,0,1e300,0,0,0"), with_xor("VNERR,07"));
    EXPECT_EQ(unit.ask("VNWRG," + std::string(id) + ",1,0,0,0,1,0,0,0,1,-1e308,0,0"), with_xor("VNERR,07"));
  }
  EXPECT_EQ(unit.ask("VNWRG,26,1e200,0,0,0,1e-200,0,0,0,1"), with_xor("VNERR,07"));
  const std::string sent = unit.run(1).at(0);
  EXPECT_EQ(sent.find("nan"), std::string::npos) << sent;
  EXPECT_EQ(sent.find("inf"), std::string::npos) << sent;
}

TEST(VectorNavRegisters, CountsAreResetAndNotSet) {
  Unit unit;
  for (const char* counts : {"5,0,7", "0,0,0"}) {
    EXPECT_EQ(unit.ask("VNWRG,33," + std::string(counts)), with_xor("VNWRG,33," + std::string(counts)));
    EXPECT_EQ(unit.ask("VNRRG,33"), with_xor("VNRRG,33,0,0,0"));
  }
}

TEST(VectorNavRegisters, AResetUndoesACalibrationThatIsNotStored) {
  Unit unit;
  unit.sample.rate = {0.5, 0, 0};
  const auto rate = [&] {
    unit.run(1);
    return unit.ask("VNRRG,19").substr(10, 10);
  };
  unit.ask("VNWRG,84,2,0,0,0,1,0,0,0,1,0,0,0");
  EXPECT_EQ(rate(), "+01.000000");
  unit.ask("VNRST");
  EXPECT_EQ(rate(), "+00.500000");
  unit.ask("VNWRG,84,2,0,0,0,1,0,0,0,1,0,0,0");
  unit.ask("VNWNV");
  unit.ask("VNRST");
  EXPECT_EQ(rate(), "+01.000000");
  unit.ask("VNRFS");
  EXPECT_EQ(rate(), "+00.500000");
}

// How many parameters the SDK's registers have (Interface/Registers.cpp).
TEST(VectorNavRegisters, HaveTheirParameters) {
  Unit unit({{"model", std::string("vn-300")}});
  unit.run(1);
  for (const auto& [id, count] : std::initializer_list<std::pair<int, int>>{
           {8, 3},   {9, 4},   {15, 13}, {17, 3},  {18, 3},   {19, 3},   {20, 9},  {21, 6},  {23, 12},
           {25, 12}, {26, 9},  {27, 12}, {30, 7},  {32, 9},   {33, 3},   {35, 4},  {36, 9},  {38, 9},
           {44, 3},  {47, 12}, {50, 3},  {51, 3},  {54, 11},  {55, 5},   {57, 3},  {58, 15}, {59, 15},
           {63, 15}, {64, 15}, {67, 4},  {72, 15}, {73, 15},  {74, 7},   {80, 7},  {82, 5},  {83, 9},
           {84, 12}, {85, 10}, {93, 6},  {97, 9},  {103, 15}, {104, 15}, {239, 9}, {240, 9}}) {
    const std::string answer = unit.ask("VNRRG," + std::to_string(id));
    EXPECT_EQ(std::count(answer.begin(), answer.end(), ','), count + 1) << answer;
  }
  EXPECT_EQ(unit.ask("VNWRG,47,1,0,0,0,1,0,0,0,1,0,0,0"), with_xor("VNERR,09"));
}

TEST(VectorNavRegisters, ReceiversAreConfiguredInModelsThatHaveThem) {
  Unit vn100, vn200({{"model", std::string("vn-200")}}), vn300({{"model", std::string("vn-300")}});
  for (const char* id : {"55", "57", "67", "74"}) {
    EXPECT_EQ(vn100.ask("VNRRG," + std::string(id)), with_xor("VNERR,08")) << id;
    EXPECT_NE(vn200.ask("VNRRG," + std::string(id)), with_xor("VNERR,08")) << id;
  }
  for (const char* id : {"93", "97", "103", "104"}) {
    EXPECT_EQ(vn200.ask("VNRRG," + std::string(id)), with_xor("VNERR,08")) << id;
    EXPECT_NE(vn300.ask("VNRRG," + std::string(id)), with_xor("VNERR,08")) << id;
  }
}

// The SDK 0.99's registers (Interface/Registers.cpp) that firmware 2 does not have.
TEST(VectorNavRegisters, NewerFirmwareHasMore) {
  for (const auto& [model, receivers] : {std::pair{"vn-100", 0}, {"vn-200", 1}, {"vn-300", 2}}) {
    Unit older({{"model", std::string(model)}}),
        newer({{"model", std::string(model)}, {"firmware", std::string("3.1.0.0")}});
    EXPECT_EQ(older.ask("VNRRG,04"), with_xor("VNRRG,04,2.1.0.0"));
    EXPECT_EQ(newer.ask("VNRRG,04"), with_xor("VNRRG,04,3.1.0.0"));
    for (const auto& [id, count, fewest] : std::initializer_list<std::tuple<int, int, int>>{{86, 8, 2},
                                                                                            {98, 2, 2},
                                                                                            {99, 8, 1},
                                                                                            {100, 7, 1},
                                                                                            {101, 5, 1},
                                                                                            {102, 5, 1},
                                                                                            {105, 6, 1},
                                                                                            {115, 3, 0},
                                                                                            {116, 7, 0},
                                                                                            {144, 6, 1},
                                                                                            {157, 3, 1},
                                                                                            {206, 4, 0}}) {
      const std::string question = "VNRRG," + std::to_string(id), answer = newer.ask(question);
      EXPECT_EQ(older.ask(question), with_xor("VNERR,08")) << id;
      if (receivers < fewest)
        EXPECT_EQ(answer, with_xor("VNERR,08")) << model << " " << id;
      else
        EXPECT_EQ(std::count(answer.begin(), answer.end(), ','), count + 1) << answer;
    }
  }
}

TEST(VectorNavRegisters, NewerFirmwareHasHeave) {
  Unit older, newer({{"firmware", std::string("3.1.0.0")}});
  EXPECT_EQ(older.ask("VNWRG,06,34"), with_xor("VNERR,07"));
  EXPECT_EQ(newer.ask("VNWRG,06,34"), with_xor("VNWRG,06,34"));
  EXPECT_EQ(newer.run(1).at(0), with_xor("VNHVE,+000.000,+000.000,+000.000"));
  EXPECT_EQ(newer.ask("VNRRG,115"), with_xor("VNRRG,115,+000.000,+000.000,+000.000"));
  EXPECT_EQ(newer.ask("VNWRG,115,0,0,0"), with_xor("VNERR,09"));
  EXPECT_EQ(newer.ask("VNWRG,06,1086"), with_xor("VNERR,07")) << "no message";
}

TEST(VectorNavRegisters, SomeParametersAreHexadecimal) {
  Unit unit({{"model", std::string("vn-200")}, {"firmware", std::string("3.1.0.0")}});
  for (const char* body : {"VNWRG,99,005F,5,5,32,07,00FF,FFFF,007F", "VNWRG,101,2,5,0,0,1FAB"}) {
    EXPECT_EQ(unit.ask(body), with_xor(body));
  }
  EXPECT_EQ(unit.ask("VNRRG,99"), with_xor("VNRRG,99,005F,5,5,32,07,00FF,FFFF,007F"));
  for (const char* body : {"VNWRG,99,005G,5,5,32,07,00FF,FFFF,007F", "VNWRG,99,005F,5,5,3A,07,00FF,FFFF,007F"})
    EXPECT_EQ(unit.ask(body), with_xor("VNERR,07")) << body;
}

TEST(VectorNavRegisters, AFirmwareHasFourNumbers) {
  const Protocol& protocol = *find_protocol("vectornav");
  for (const char* wrong : {"", "3", "3.1.0", "3.1.0.0.0", "a.1.0.0", ".1.0.0", "3.1.0.0-beta", "300.0.0.0", "3...",
                            "3.1..0", "3.1.0.", "3.1.0.70000"}) {
    Settings settings(protocol.settings);
    settings.set("firmware", std::string(wrong));
    EXPECT_THROW(protocol.make(settings), std::invalid_argument) << wrong;
  }
}

// github.com/winksaville/rw-vn100 4c70450, README.md, with firmware 3.1.0.0.
TEST(VectorNavRegisters, ARateOf0IsOff) {
  Unit unit;
  EXPECT_EQ(unit.send("$VNWRG,07,0*6D\r\n"), "$VNWRG,07,0*6D\r\n");
  EXPECT_EQ(unit.ask("VNRRG,07"), with_xor("VNRRG,07,0"));
  EXPECT_TRUE(unit.run(800).empty());
  EXPECT_EQ(unit.ask("VNWRG,07,1"), with_xor("VNWRG,07,1"));
  EXPECT_EQ(unit.run(800).size(), 1U);
}

TEST(VectorNavRegisters, TheSecondReceiverHasMessages) {
  Unit vn200({{"model", std::string("vn-200")}}), unit({{"model", std::string("vn-300")}});
  EXPECT_EQ(vn200.ask("VNWRG,06,32"), with_xor("VNERR,07"));
  for (const auto& [type, name, first] : {std::tuple{"32", "$VNG2S,", "58"}, {"33", "$VNG2E,", "59"}}) {
    EXPECT_EQ(unit.ask("VNWRG,06," + std::string(type)), with_xor("VNWRG,06," + std::string(type)));
    const auto sent = unit.run(400);
    ASSERT_EQ(sent.size(), 40U);
    const std::string same = unit.ask("VNRRG," + std::string(first));
    EXPECT_EQ(sent[39].substr(0, 7), name);
    EXPECT_EQ(sent[39].substr(7, sent[39].find('*') - 7), same.substr(10, same.find('*') - 10));
  }
}

// 3 in the SDK's ProtocolControl, 2 in vnproglib's ChecksumMode.
TEST(VectorNavRegisters, Register30ChoosesTheChecksumOfTheStream) {
  for (const char* form : {"2", "3"}) {
    Unit unit({{"async_type", std::int64_t{1}}});
    unit.ask("VNWRG,30,0,0,0,0," + std::string(form) + ",0,1");
    EXPECT_EQ(unit.run(1).at(0), with_crc("VNYPR,+000.000,+000.000,+000.000"));
  }
}

// The SDK (AsciiPacketProtocol.cpp, parsePacket) takes "T" and a decimal count, "S" and a hexadecimal status at the
// end.
TEST(VectorNavRegisters, Register30AppendsCountAndStatus) {
  Unit unit({{"async_type", std::int64_t{1}}});
  EXPECT_EQ(unit.ask("VNWRG,30,1,1,0,0,1,0,1"), with_xor("VNWRG,30,1,1,0,0,1,0,1"));
  EXPECT_EQ(unit.run(1).at(0), with_xor("VNYPR,+000.000,+000.000,+000.000,S0000,T0"));
  unit.ask("VNWRG,06,12");
  unit.sample.rate = {0.5, 0, 0};
  const std::string gyro = unit.run(800).at(0);
  const Protocol& protocol = *find_protocol("vectornav");
  Recording recording;
  protocol.make_decoder(Settings(protocol.settings))->feed({std::as_bytes(std::span(gyro))}, recording);
  ASSERT_EQ(recording.measurements.size(), 1U);
  EXPECT_EQ(recording.measurements[0].sample.rate, unit.sample.rate);
  Unit ins({{"model", std::string("vn-200")}, {"async_type", std::int64_t{1}}});
  ins.sample.navigation.is_known = true;
  ins.ask("VNWRG,30,0,2,0,0,1,0,1");
  EXPECT_EQ(ins.run(1).at(0), with_xor("VNYPR,+000.000,+000.000,+000.000,S0006"));
}

// vnproglib 1.2, types.h, ErrorMode: ignore, send, send and set register 6 to off.
TEST(VectorNavRegisters, Register30ConfiguresErrors) {
  Unit unit;
  unit.ask("VNWRG,30,0,0,0,0,1,0,0");
  EXPECT_EQ(unit.ask("VNXYZ"), "");
  EXPECT_EQ(unit.send("$VNRRG,01*00\r\n"), "");
  EXPECT_EQ(unit.ask("VNRRG,07"), with_xor("VNRRG,07,40"));
  EXPECT_EQ(unit.run(800).size(), 40U);
  unit.ask("VNWRG,30,0,0,0,0,1,0,1");
  EXPECT_EQ(unit.ask("VNXYZ"), with_xor("VNERR,04"));
  EXPECT_EQ(unit.run(800).size(), 40U);
  unit.ask("VNWRG,30,0,0,0,0,1,0,2");
  EXPECT_EQ(unit.ask("VNXYZ"), with_xor("VNERR,04"));
  EXPECT_TRUE(unit.run(800).empty());
  EXPECT_EQ(unit.ask("VNRRG,06"), with_xor("VNRRG,06,0"));
}

TEST(VectorNavRegisters, CommandsOfTheFilterAreEchoed) {
  Unit unit;
  for (const char* body : {"VNSIH,10.000000", "VNSIH,1.0,2.0,3.0", "VNSFB", "VNSGB", "VNKMD,1", "VNKAD,0"})
    EXPECT_EQ(unit.ask(body), with_xor(body));
}

}  // namespace
}  // namespace imud
