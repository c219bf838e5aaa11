// The two UARTs of a VectorNav: at which one the host is, what leaves at which one, and what it concerns.
#include <gtest/gtest.h>

#include "tests/protocols/vectornav/vectornav_unit.hpp"

namespace imud {
namespace {

using namespace vectornav_test;

std::vector<std::string> beginning_with(const std::vector<std::string>& all, std::string_view begin) {
  std::vector<std::string> some;
  for (const std::string& one : all)
    if (one.starts_with(begin)) some.push_back(one);
  return some;
}

// PX4-Autopilot 004d420, src/drivers/ins/vectornav/VectorNav.cpp, init() and configure(), as its library sends them.
constexpr const char* px4[] = {
    "$VNRRG,01*72\r\n", "$VNWRG,05,921600*53\r\n", "$VNRRG,01*72\r\n",   "$VNRRG,02*71\r\n",
    "$VNRRG,03*70\r\n", "$VNRRG,04*77\r\n",        "$VNWRG,06,0*6C\r\n", "$VNRRG,35*75\r\n",
};
constexpr const char* px4_outputs[] = {"VNWRG,75,2,1,6,1,C", "VNWRG,76,2,8,36,1,130,84,613",
                                       "VNWRG,77,2,80,A,1,26B9"};

TEST(VectorNavUarts, Px4AtUart2GetsItsThreeOutputs) {
  Unit unit({{"model", std::string("vn-200")}, {"uart", std::int64_t{2}}});
  for (const char* line : px4) {
    const std::string answer = unit.send(line);
    EXPECT_EQ(answer.substr(0, 9), std::string(line).substr(0, 9));
    EXPECT_EQ(answer.find("VNERR"), std::string::npos);
  }
  EXPECT_EQ(unit.device->uart().baud, 921'600U);
  EXPECT_EQ(unit.ask("VNWRG,35,1,0,1,1"), with_xor("VNWRG,35,1,0,1,1"));
  for (const char* body : px4_outputs) EXPECT_EQ(unit.ask(body), with_xor(body));
  EXPECT_EQ(unit.device->counts()[0], 0U);
  // The driver tells the outputs by groups and masks.
  const auto sent = unit.run(800);
  EXPECT_EQ(beginning_with(sent, std::string("\xFA\x06\x01\x00\x0C\x00", 6)).size(), 800U);
  EXPECT_EQ(beginning_with(sent, std::string("\xFA\x36\x01\x00\x30\x01\x84\x00\x13\x06", 10)).size(), 100U);
  EXPECT_EQ(beginning_with(sent, std::string("\xFA\x0A\x01\x00\xB9\x26", 6)).size(), 10U);
  EXPECT_EQ(sent.size(), 910U);
}

TEST(VectorNavUarts, Px4AtUart1GetsNothingAndIsCounted) {
  Unit unit;
  for (const char* line : px4) unit.send(line);
  std::uint64_t counted = 0;
  for (const char* body : px4_outputs) {
    EXPECT_EQ(unit.ask(body), with_xor(body));
    EXPECT_EQ(unit.device->counts()[0], ++counted);
  }
  EXPECT_TRUE(unit.run(800).empty());
}

TEST(VectorNavUarts, OnlyWhatGoesNowhereElseIsCounted) {
  Unit unit;
  for (const char* body : {"VNWRG,75,1,8,01,0001", "VNWRG,75,3,8,01,0001", "VNWRG,75,0,8,01,0001", "VNWRG,75,2,8,00",
                           "VNWRG,06,0,2", "VNWRG,06,14", "VNWRG,06,14,1", "VNWRG,07,10,2"}) {
    EXPECT_EQ(unit.ask(body), with_xor(body));
    EXPECT_EQ(unit.device->counts()[0], 0U) << body;
  }
  EXPECT_EQ(unit.ask("VNWRG,06,14,2"), with_xor("VNWRG,06,14,2"));
  EXPECT_EQ(unit.device->counts()[0], 1U);
  Unit both;
  both.device->connect_second_uart();
  EXPECT_EQ(both.ask("VNWRG,75,2,8,01,0001"), with_xor("VNWRG,75,2,8,01,0001"));
  EXPECT_EQ(both.device->counts()[0], 0U);
}

TEST(VectorNavUarts, AConfiguredOutputThatGoesNowhereIsCounted) {
  for (const auto& [binary, count] : {std::pair{"2,8,01,0001", 1U}, {"1,8,01,0001", 0U}, {"3,8,01,0001", 0U}}) {
    Unit unit({{"binary_2", std::string(binary)}});
    EXPECT_EQ(unit.device->counts()[0], count) << binary;
    unit.device->connect_second_uart();
    EXPECT_EQ(unit.device->counts()[0], 0U) << binary;
  }
}

// rw-vn100 4c70450, src/lib.rs, `set-bin-fields=time,accel`, `set-bin=on`, of a unit whose UART 2 is connected; the
// answers are those of its test-data and notes.
TEST(VectorNavUarts, RwVn100sSetBin) {
  Unit unit({{"uart", std::int64_t{2}}, {"firmware", std::string("3.1.0.0")}});
  EXPECT_EQ(unit.send("$VNRRG,75*71\r\n"), with_xor("VNRRG,75,0,0,00"));
  EXPECT_EQ(unit.ask("VNWRG,75,0,20,01,0101"), with_xor("VNWRG,75,0,20,01,0101"));
  EXPECT_EQ(unit.ask("VNRRG,75"), with_xor("VNRRG,75,0,20,01,0101"));
  EXPECT_EQ(unit.ask("VNWRG,75,2,20,01,0101"), with_xor("VNWRG,75,2,20,01,0101"));
  const auto sent = unit.run(800);
  EXPECT_EQ(beginning_with(sent, std::string("\xFA\x01\x01\x01", 4)).size(), 40U);
  EXPECT_EQ(beginning_with(sent, "$VNYMR,").size(), 40U);
  EXPECT_EQ(sent.size(), 80U);
}

// rw-vn100 4c70450, README.md: transcripts with a VN-100 of firmware 3.1.0.0.
TEST(VectorNavUarts, RwVn100sTranscripts) {
  Unit unit({{"firmware", std::string("3.1.0.0")}});
  EXPECT_EQ(unit.send("$VNRRG,07*74\r\n"), "$VNRRG,07,40*5C\r\n");
  EXPECT_EQ(unit.send("$VNWRG,05,115200*58\r\n"), "$VNWRG,05,115200*58\r\n");
  EXPECT_EQ(unit.send("$VNWRG,07,40*59\r\n"), "$VNWRG,07,40*59\r\n");
  EXPECT_EQ(unit.send("$VNWRG,75,1,4,01,0101*70\r\n"), "$VNWRG,75,1,4,01,0101*70\r\n");
  EXPECT_EQ(unit.send("$VNWRG,07,0*6D\r\n"), "$VNWRG,07,0*6D\r\n");
  const auto sent = unit.run(800);
  EXPECT_EQ(sent.size(), 200U) << "200 Hz, and no text";
  EXPECT_EQ(sent.at(0).size(), 26U);
  EXPECT_EQ(unit.send("$VNWRG,07,40*59\r\n"), "$VNWRG,07,40*59\r\n");
  EXPECT_EQ(unit.run(800).size(), 240U);
  EXPECT_EQ(unit.ask("VNRRG,01"), with_xor("VNRRG,01,VN-100S-CR"));
  EXPECT_EQ(unit.ask("VNRRG,04"), with_xor("VNRRG,04,3.1.0.0"));
}

// rw-vn100 4c70450, notes/chores/chores-01.md and README.md: what a VN-100 accepted beside its text at 40 Hz.
TEST(VectorNavUarts, TheLoadOfALineIsLimitedAsInARealUnit) {
  const std::string refused = with_xor("VNERR,0C");
  for (const std::int64_t uart : {1, 2}) {
    Unit unit({{"uart", uart}});
    const auto binary = [&](const std::string& rest) {
      const std::string body = "VNWRG,75," + std::to_string(uart) + "," + rest;
      const std::string answer = unit.ask(body);
      EXPECT_TRUE(answer == with_xor(body) || answer == refused) << answer;
      return answer != refused;
    };
    EXPECT_TRUE(binary("4,01,0101")) << "time and acceleration at 200 Hz";
    EXPECT_TRUE(binary("4,01,0120")) << "acceleration and rate";
    EXPECT_FALSE(binary("4,01,0121")) << "time, acceleration and rate";
    EXPECT_FALSE(binary("4,01,0131")) << "and a quaternion";
    EXPECT_EQ(unit.ask("VNWRG,75,0,0,00"), with_xor("VNWRG,75,0,0,00"));
    EXPECT_EQ(unit.ask("VNWRG,07,50"), with_xor("VNWRG,07,50"));
    EXPECT_EQ(unit.ask("VNWRG,07,100"), refused);
    EXPECT_EQ(unit.ask("VNWRG,07,200"), refused);
    EXPECT_EQ(unit.ask("VNWRG,07,40"), with_xor("VNWRG,07,40"));
    EXPECT_EQ(unit.ask("VNWRG,05,57600"), with_xor("VNWRG,05,57600"));
    EXPECT_FALSE(binary("20,01,0101")) << "40 Hz beside the text";
    EXPECT_EQ(unit.ask("VNWRG,07,4"), with_xor("VNWRG,07,4"));
    EXPECT_TRUE(binary("20,01,0101"));
  }
}

TEST(VectorNavUarts, EachHasItsRegisters) {
  Unit unit({{"uart", std::int64_t{2}}, {"async_hz", std::int64_t{20}}});
  unit.device->connect_second_uart();
  EXPECT_EQ(unit.ask("VNRRG,07"), with_xor("VNRRG,07,20"));
  EXPECT_EQ(unit.ask("VNRRG,07,?"), with_xor("VNRRG,07,20,2"));
  EXPECT_EQ(unit.ask("VNRRG,07,1"), with_xor("VNRRG,07,40,1"));
  EXPECT_EQ(unit.ask("VNRRG,07", 1), with_xor("VNRRG,07,40"));
  EXPECT_EQ(unit.ask("VNRRG,07,0", 1), with_xor("VNRRG,07,40,1"));
  EXPECT_EQ(unit.ask("VNWRG,05,57600", 1), with_xor("VNWRG,05,57600"));
  EXPECT_EQ(unit.device->uart().baud, 115'200U);
  EXPECT_EQ(unit.device->second_uart().baud, 57'600U);
  EXPECT_EQ(unit.ask("VNWRG,05,230400,2", 1), with_xor("VNWRG,05,230400,2"));
  EXPECT_EQ(unit.device->uart().baud, 230'400U);
  const auto sent = unit.run_both(800);
  EXPECT_EQ(sent[0].size(), 20U);
  EXPECT_EQ(sent[1].size(), 40U);
  EXPECT_EQ(unit.ask("VNWRG,06,0", 1), with_xor("VNWRG,06,0"));
  EXPECT_TRUE(unit.run_both(800)[1].empty());
}

TEST(VectorNavUarts, TheSecondsTextIsConfigured) {
  for (const std::int64_t uart : {1, 2}) {
    Unit unit({{"uart", uart},
               {"baud", std::int64_t{9600}},
               {"async_type", std::int64_t{0}},
               {"second_async_type", std::int64_t{1}},
               {"second_async_hz", std::int64_t{4}}});
    unit.device->connect_second_uart();
    const auto sent = unit.run_both(800);
    EXPECT_TRUE(sent[0].empty());
    EXPECT_EQ(beginning_with(sent[1], "$VNYPR,").size(), 4U);
    EXPECT_EQ(sent[1].size(), 4U);
  }
  const Protocol& protocol = *find_protocol("vectornav");
  for (const auto& [key, wrong] : {std::pair{"second_async_type", 22}, {"second_async_hz", 33}}) {
    Settings settings(protocol.settings);
    settings.set(key, std::int64_t{wrong});
    EXPECT_THROW(protocol.make(settings), std::invalid_argument) << key;
  }
}

TEST(VectorNavUarts, AnOutputLeavesAtItsUarts) {
  for (const auto& [mode, at_port, at_second] :
       {std::tuple{"0", 0U, 0U}, {"1", 100U, 0U}, {"2", 0U, 100U}, {"3", 100U, 100U}}) {
    Unit unit({{"async_type", std::int64_t{0}}});
    unit.device->connect_second_uart();
    EXPECT_EQ(unit.ask("VNWRG,06,0", 1), with_xor("VNWRG,06,0"));
    const std::string body = "VNWRG,75," + std::string(mode) + ",8,01,0801";
    EXPECT_EQ(unit.ask(body), with_xor(body));
    const auto sent = unit.run_both(800);
    EXPECT_EQ(sent[0].size(), at_port) << mode;
    EXPECT_EQ(sent[1].size(), at_second) << mode;
    if (at_port == at_second) {
      EXPECT_EQ(sent[0], sent[1]);
    }
    EXPECT_EQ(unit.ask("VNBOM,1", 1).size(), 4U + 8 + 28 + 2) << "polled by the host that asks";
  }
}

// UM001, page 56: on the serial port for which the command is received.
TEST(VectorNavUarts, APauseConcernsTheUartOfTheCommand) {
  Unit unit({{"async_type", std::int64_t{30}}, {"binary_1", std::string("3,8,01,0800")}});
  unit.device->connect_second_uart();
  EXPECT_EQ(unit.ask("VNWRG,06,30", 1), with_xor("VNWRG,06,30"));
  EXPECT_EQ(unit.ask("VNASY,0", 1), with_xor("VNASY,0"));
  auto sent = unit.run_both(800);
  EXPECT_EQ(sent[0].size(), 140U);
  EXPECT_TRUE(sent[1].empty());
  EXPECT_EQ(unit.ask("VNASY,1", 1), with_xor("VNASY,1"));
  sent = unit.run_both(800);
  EXPECT_EQ(sent[0].size(), 140U);
  EXPECT_EQ(sent[1].size(), 140U);
  EXPECT_EQ(beginning_with(sent[1], "$").at(0).substr(0, 16), "$VNDTV,+0.001250") << "none of the pause";
  EXPECT_EQ(beginning_with(sent[0], "$").at(1).substr(0, 16), "$VNDTV,+0.025000");
}

// An output without fields sends nothing, and what was sent before it is not sent once more.
TEST(VectorNavUarts, AnEmptyOutputToBothSendsNothing) {
  for (const char* empty : {"3,8,00", "3,8,01,0000"}) {
    Unit unit;
    unit.device->connect_second_uart();
    const std::string body = "VNWRG,76," + std::string(empty);
    EXPECT_EQ(unit.ask("VNWRG,06,0", 1), with_xor("VNWRG,06,0"));
    EXPECT_EQ(unit.ask("VNWRG,75,1,8,01,0001"), with_xor("VNWRG,75,1,8,01,0001"));
    EXPECT_EQ(unit.ask(body), with_xor(body));
    const auto sent = unit.run_both(800);
    EXPECT_EQ(sent[0].size(), 140U);
    EXPECT_TRUE(sent[1].empty()) << empty;
  }
}

TEST(VectorNavUarts, AResumedUartTakesNoIncrementsFromTheOther) {
  Unit unit({{"async_type", std::int64_t{0}}, {"binary_1", std::string("3,8,01,0800")}});
  unit.device->connect_second_uart();
  EXPECT_EQ(unit.ask("VNWRG,06,0", 1), with_xor("VNWRG,06,0"));
  unit.run_both(1);
  for (const char* body : {"VNASY,0", "VNASY,1"}) {
    unit.run_both(4);
    EXPECT_EQ(unit.ask(body, 1), with_xor(body));
    const auto sent = unit.run_both(4);
    ASSERT_EQ(sent[0].size(), 1U);
    EXPECT_FLOAT_EQ(real_at(sent[0][0], 4), 8 / 800.0F) << body;
  }
  EXPECT_EQ(unit.ask("VNASY,0"), with_xor("VNASY,0"));
  EXPECT_EQ(unit.ask("VNASY,0", 1), with_xor("VNASY,0"));
  unit.run_both(4);
  EXPECT_EQ(unit.ask("VNASY,1"), with_xor("VNASY,1"));
  EXPECT_FLOAT_EQ(real_at(unit.run_both(4)[0].at(0), 4), 4 / 800.0F) << "both had paused";
}

TEST(VectorNavUarts, CommandsAtTheTwoDoNotMix) {
  Unit unit;
  unit.device->connect_second_uart();
  EXPECT_EQ(unit.send("$VNRRG,0"), "");
  EXPECT_EQ(unit.send("$VNRRG,04*77\r\n", 1), with_xor("VNRRG,04,2.1.0.0"));
  EXPECT_EQ(unit.send("1*72\r\n"), with_xor("VNRRG,01,VN-100S-CR"));
  EXPECT_EQ(unit.ask("VNXYZ", 1), with_xor("VNERR,04"));
}

// VNYMR has 122 bytes, the longest count ",T4294967295" has 12, and the status ",S0000" has 6.
TEST(VectorNavUarts, TheLoadHasTheLongestAppendedCount) {
  Unit unit({{"baud", std::int64_t{128'000}}});
  EXPECT_EQ(unit.ask("VNWRG,07,100"), with_xor("VNWRG,07,100"));
  EXPECT_EQ(unit.ask("VNWRG,30,1,0,0,0,1,0,1"), with_xor("VNERR,0C"));
  EXPECT_EQ(unit.ask("VNWRG,30,0,1,0,0,1,0,1"), with_xor("VNWRG,30,0,1,0,0,1,0,1"));
}

TEST(VectorNavUarts, TheLoadOfEachConnectedUartIsLimited) {
  Unit unit;
  unit.device->connect_second_uart();
  EXPECT_EQ(unit.ask("VNWRG,75,2,1,6,1,C"), with_xor("VNERR,0C"));
  EXPECT_EQ(unit.ask("VNWRG,05,921600,2"), with_xor("VNWRG,05,921600,2"));
  EXPECT_EQ(unit.ask("VNWRG,75,2,1,6,1,C"), with_xor("VNWRG,75,2,1,6,1,C"));
  EXPECT_EQ(unit.ask("VNWRG,75,3,1,6,1,C"), with_xor("VNERR,0C"));
  EXPECT_EQ(unit.ask("VNWRG,05,115200", 1), with_xor("VNERR,0C"));
}

}  // namespace
}  // namespace imud
