// VectorNav against what its clients send and expect.
#include <gtest/gtest.h>

#include <array>
#include <cstdio>
#include <random>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/attitude.hpp"
#include "core/units.hpp"
#include "tests/protocols/recording.hpp"
#include "tests/protocols/table_names.hpp"
#include "tests/protocols/vectornav/vectornav_unit.hpp"

namespace imud {
namespace {

using namespace vectornav_test;

// tstellanova/vectornav_vn300 f2569cd, test/test_decoder.c.
TEST(VectorNav, TheChecksumOfTheseTestsIsTheirs) {
  EXPECT_EQ(crc16("ROCK"), 0x08FFU);
  EXPECT_EQ(crc16("12345678"), 0x9015U);
}

TEST(VectorNav, NumbersAreAsPrintfWritesThem) {
  constexpr struct {
    vectornav::Digits digits;
    const char* format;
  } forms[] = {{{3, 8, true}, "%+08.3f"},    {{6, 10, true}, "%+010.6f"}, {{8, 13, true}, "%+013.8f"},
               {{6, 13}, "%013.6f"},         {{0, 4}, "%04.0f"},          {{1}, "%.1f"},
               {vectornav::Digits{}, "%.0f"}};
  std::vector<double> numbers = {0.0, -0.0, 0.5, 1.5, 2.5, -0.5, 0.0005, -0.0005, 0.0015, 0.125, 999.9995, -1e15};
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal;
  for (int i = 0; i < 5000; ++i)
    for (const double scale : {1e-4, 1.0, 1e3, 1e9}) numbers.push_back(scale * normal(random));
  FrameBuffer out;
  for (const auto& form : forms)
    for (const double number : numbers) {
      out.clear();
      vectornav::Message(out, vectornav::Form::two_digits, 0).put(number, form.digits).send();
      const std::span<const std::byte> bytes = out.frames()[0].bytes;
      const std::string_view sent(reinterpret_cast<const char*>(bytes.data()), bytes.size());
      std::array<char, 64> text;
      std::snprintf(text.data(), text.size(), form.format, number);
      ASSERT_EQ(sent.substr(2, sent.find('*') - 2), text.data());
    }
}

// Lines as vnproglib, the SDK and ArduPilot sent them.
TEST(VectorNav, AnswersInTheFormThatTheHostUsed) {
  Unit unit;
  EXPECT_EQ(unit.send("$VNRRG,01*72\r\n"), with_xor("VNRRG,01,VN-100S-CR"));
  EXPECT_EQ(unit.send("$VNRRG,01*E15F\r\n"), with_crc("VNRRG,01,VN-100S-CR"));
  EXPECT_EQ(unit.send("$VNASY,0*4F\r\n"), "$VNASY,0*4F\r\n");
  EXPECT_EQ(unit.send("$VNWRG,06,0*6C\r\n"), "$VNWRG,06,0*6C\r\n");
  EXPECT_EQ(unit.send("$VNWRG,75,3,20,1,529*4A\r\n"), "$VNWRG,75,3,20,1,529*4A\r\n");
  EXPECT_EQ(unit.send("$VNWRG,75,3,400,01,0321*D84E\r\n"), "$VNWRG,75,3,400,01,0321*D84E\r\n");
  EXPECT_EQ(unit.send("$VNWRG,75,3,16,01,0721*D415\r\n"), "$VNWRG,75,3,16,01,0721*D415\r\n");
  EXPECT_EQ(unit.ask("VNRRG,75"), with_xor("VNRRG,75,3,16,01,0721"));
  EXPECT_EQ(unit.send("$VNRRG,5*XX\r\n"), with_xor("VNRRG,5,115200"));
}

TEST(VectorNav, ErrorsHaveTheirCodes) {
  Unit unit;
  const auto error = [](unsigned code) { return with_xor("VNERR," + hex_digits(code, 2)); };
  EXPECT_EQ(unit.send("$VNRRG,01*73\r\n"), error(3));
  EXPECT_EQ(unit.send("$VNRRG,01\r\n"), error(3));
  EXPECT_EQ(unit.send("$VNRRG,01*E15E\r\n"), with_crc("VNERR,03"));
  EXPECT_EQ(unit.ask("VNXYZ"), error(4));
  EXPECT_EQ(unit.ask("VN"), error(4));
  EXPECT_EQ(unit.ask("VNRRGG,1"), error(4));
  EXPECT_EQ(unit.ask("VNRRG"), error(5));
  EXPECT_EQ(unit.ask("VNWRG,7"), error(5));
  EXPECT_EQ(unit.ask("VNWRG,35,1,1"), error(5));
  EXPECT_EQ(unit.ask("VNWRG,75,3,16,03,0001"), error(5));
  EXPECT_EQ(unit.ask("VNWRG,35,1,1,1,1,1"), error(6));
  EXPECT_EQ(unit.ask("VNWRG,75,3,16,01,0001,0001"), error(6));
  EXPECT_EQ(unit.ask("VNWRG,7,41"), error(7));
  EXPECT_EQ(unit.ask("VNWRG,5,115201"), error(7));
  EXPECT_EQ(unit.ask("VNWRG,35,1,x,1,1"), error(7));
  EXPECT_EQ(unit.ask("VNWRG,75,4,8,01,0001"), error(7)) << "no such port";
  EXPECT_EQ(unit.ask("VNBOM,1"), error(7)) << "it has no fields";
  EXPECT_EQ(unit.ask("VNWRG,75,3,16,02,0400"), error(7)) << "no such field";
  EXPECT_EQ(unit.ask("VNASY,2"), error(7));
  EXPECT_EQ(unit.ask("VNRRG,99"), error(8));
  EXPECT_EQ(unit.ask("VNRRG,99,1"), error(8)) << "asked so by the SDK's RegisterScan, which ends at any other error";
  EXPECT_EQ(unit.ask("VNRRG,80,1"), error(6));
  EXPECT_EQ(unit.ask("VNWRG,99,1"), error(8));
  for (const char* id : {"1", "2", "3", "4"}) EXPECT_EQ(unit.ask("VNWRG," + std::string(id) + ",1"), error(9)) << id;
  for (const char* body : {"VNRRG,", "VNWRG,", "VNASY,", "VNBOM,"}) EXPECT_EQ(unit.ask(body), error(5)) << body;
  for (const char* body : {"VNRRG,01,1", "VNRRG,01,1,2", "VNRRG,05,1,2", "VNTAR,1,2", "VNWNV,1", "VNRST,5", "VNRFS,1",
                           "VNASY,0,1", "VNBOM,1,2"})
    EXPECT_EQ(unit.ask(body), error(6)) << body;
  EXPECT_EQ(unit.run(800).size(), 40U) << "it still streams";
  EXPECT_EQ(unit.ask("VNWRG,58,1"), error(8)) << "a VN-100 has no receiver";
}

TEST(VectorNav, StreamsOutOfTheBox) {
  Unit unit;
  unit.sample.rate = {0.5, -0.25, 0.125};
  unit.sample.q_LP = Quaternion(dcm_from_yaw_pitch_roll(-2.0, 0.1, 3.0).transpose());
  const auto sent = unit.run(800);
  ASSERT_EQ(sent.size(), 40U);
  EXPECT_EQ(sent[0], with_xor("VNYMR,-114.592,+005.730,+171.887,+00.0000,+00.0000,+00.0000,+00.000,+00.000,-09.807,"
                              "+00.500000,-00.250000,+00.125000"));
  const auto decoder = find_protocol("vectornav")->make_decoder(Settings(find_protocol("vectornav")->settings));
  Recording recording;
  for (const std::string& one : sent) decoder->feed({std::as_bytes(std::span(one))}, recording);
  ASSERT_EQ(recording.measurements.size(), 40U);
  EXPECT_EQ(recording.measurements[3].sample.rate, unit.sample.rate);
  EXPECT_NEAR(recording.measurements[3].sample.specific_force.z(), -9.80665, 5e-4);
  EXPECT_EQ(decoder->errors().skipped_bytes, 0U);
}

TEST(VectorNav, EveryMessageHasItsName) {
  for (const auto& [type, begin] : {std::pair{"1", "$VNYPR,"},
                                    {"2", "$VNQTN,"},
                                    {"8", "$VNQMR,"},
                                    {"10", "$VNMAG,"},
                                    {"11", "$VNACC,"},
                                    {"12", "$VNGYR,"},
                                    {"13", "$VNMAR,"},
                                    {"14", "$VNYMR,"},
                                    {"16", "$VNYBA,"},
                                    {"17", "$VNYIA,"},
                                    {"19", "$VNIMU,"},
                                    {"30", "$VNDTV,"}}) {
    Unit unit({{"baud", std::int64_t{921600}}});
    EXPECT_EQ(unit.ask("VNWRG,06," + std::string(type)), with_xor("VNWRG,06," + std::string(type)));
    EXPECT_EQ(unit.ask("VNWRG,07,200"), with_xor("VNWRG,07,200"));
    const auto sent = unit.run(800);
    ASSERT_EQ(sent.size(), 200U) << type;
    EXPECT_EQ(sent[0].substr(0, 7), begin);
    const std::size_t star = sent[0].find('*');
    EXPECT_EQ(sent[0], with_xor(sent[0].substr(1, star - 1)));
  }
}

// ArduPilot's dialogue with a VN-100; ArduPilot compares the first two words of each answer.
TEST(VectorNav, ArduPilotsDialogue) {
  Unit unit;
  for (const char* body :
       {"VNASY,0", "VNWRG,06,0,1", "VNWRG,06,0,2", "VNWRG,75,3,16,01,0721", "VNWRG,76,3,16,11,0001,0106"})
    EXPECT_EQ(unit.ask(body), with_xor(body));
  EXPECT_TRUE(unit.run(800).empty());
  EXPECT_EQ(unit.ask("VNASY,1"), with_xor("VNASY,1"));
  unit.sample.rate = {0, 0, 0.5};
  unit.sample.temperature_c = 31;
  const auto sent = unit.run(800);
  ASSERT_EQ(sent.size(), 100U);
  // Common: TimeStartup, AngularRate, Accel, Imu, MagPres: 8 + 12 + 12 + 24 + 20 bytes.
  EXPECT_EQ(sent[0].substr(0, 4), std::string("\xFA\x01\x21\x07", 4));
  EXPECT_EQ(sent[0].size(), 4U + 76 + 2);
  EXPECT_EQ(crc16(std::string_view(sent[0]).substr(1)), 0U);
  EXPECT_EQ(real_at(sent[0], 4 + 8 + 8), 0.5F);
  EXPECT_EQ(real_at(sent[0], 4 + 20 + 8), -9.80665F);
  EXPECT_EQ(real_at(sent[0], 4 + 56 + 12), 31.0F);
  // Common TimeStartup; Attitude YawPitchRoll, Quaternion, YprU.
  EXPECT_EQ(sent[1].substr(0, 6), std::string("\xFA\x11\x01\x00\x06\x01", 6));
  EXPECT_EQ(sent[1].size(), 6U + 8 + 12 + 16 + 12 + 2);
}

// The size of each field is vnproglib's; each alone makes a frame whose checksum is right.
TEST(VectorNav, EveryFieldHasItsSize) {
  const std::array<std::vector<int>, 7> sizes = {{{8, 8, 8, 12, 16, 12, 24, 12, 12, 24, 20, 28, 2, 4, 8},
                                                  {8, 8, 8, 2, 8, 8, 8, 4, 4, 1},
                                                  {2, 12, 12, 12, 4, 4, 16, 12, 12, 12, 12, 2, 40},
                                                  {8, 8, 2, 1, 1, 24, 24, 12, 12, 12, 4, 4, 2, 28},
                                                  {2, 12, 16, 36, 12, 12, 12, 12, 12, 12, 28, 24, 12},
                                                  {2, 24, 24, 12, 12, 12, 12, 12, 12, 4, 4, 68, 64},
                                                  {8, 8, 2, 1, 1, 24, 24, 12, 12, 12, 4, 4, 2, 28}}};
  for (unsigned group = 0; group < 7; ++group)
    for (unsigned bit = 0; bit < sizes[group].size(); ++bit) {
      Unit unit({{"async_type", std::int64_t{0}}});
      const std::string body = "VNWRG,75,1,8," + hex_digits(1U << group, 2) + "," + hex_digits(1U << bit, 4);
      ASSERT_EQ(unit.ask(body), with_xor(body));
      const auto sent = unit.run(80);
      ASSERT_EQ(sent.size(), 10U);
      EXPECT_EQ(sent[0].size(), 4U + static_cast<std::size_t>(sizes[group][bit]) + 2);
      EXPECT_EQ(crc16(std::string_view(sent[0]).substr(1)), 0U);
      EXPECT_EQ(unit.ask("VNBOM,1").size(), sent[0].size()) << "polled";
    }
}

TEST(VectorNav, IncrementsAreThoseSinceTheLastOne) {
  Unit unit(
      {{"async_type", std::int64_t{30}}, {"async_hz", std::int64_t{100}}, {"binary_1", std::string("1,4,01,0800")}});
  unit.sample.delta_angle = {1e-3, 0, -2e-3};
  unit.sample.delta_velocity = {0, 0.01, 0};
  unit.run(8);
  const auto sent = unit.run(8);  // a message at its first sample, binary frames at the first and the fifth
  ASSERT_EQ(sent.size(), 3U);
  EXPECT_EQ(sent[0].substr(0, 7), "$VNDTV,");
  EXPECT_FLOAT_EQ(real_at(sent[2], 4), 4 / 800.0F);
  EXPECT_FLOAT_EQ(real_at(sent[2], 8), static_cast<float>(4e-3 / units::degree));
  EXPECT_FLOAT_EQ(real_at(sent[2], 4 + 20), 0.04F);
}

// UM001, page 56: with divisor 0 an output is sent only when it is polled.
TEST(VectorNav, AnOutputWithoutDivisorIsPolled) {
  for (const char* mode : {"1", "3"}) {
    Unit unit({{"async_type", std::int64_t{0}}});
    const std::string output = "VNWRG,75," + std::string(mode) + ",0,01,0029";
    EXPECT_EQ(unit.ask(output), with_xor(output));
    EXPECT_TRUE(unit.run(800).empty());
    EXPECT_EQ(unit.ask("VNBOM,1").size(), 4U + 8 + 12 + 12 + 2);
  }
}

TEST(VectorNav, IncrementsBeginWithTheirOutput) {
  Unit unit;
  const auto dt = [&] { return unit.run(800 / 40).at(0).substr(0, 16); };
  const std::string first = "$VNDTV,+0.001250", one_period = "$VNDTV,+0.025000";
  unit.run(8000);
  unit.ask("VNWRG,06,30");
  EXPECT_EQ(dt(), first) << "none of the time before it was asked for";
  EXPECT_EQ(dt(), one_period);
  unit.ask("VNWRG,07,10,2");
  EXPECT_EQ(dt(), one_period) << "the other port's";
  unit.ask("VNWRG,07,40");
  EXPECT_EQ(dt(), first);
  unit.ask("VNASY,1");
  EXPECT_EQ(dt(), one_period) << "there was no pause";
  unit.ask("VNASY,0");
  unit.run(800);
  unit.ask("VNASY,1");
  EXPECT_EQ(dt(), first);
}

TEST(VectorNav, IncrementsOfABinaryOutputBeginWhenItIsWritten) {
  for (const char* id : {"75", "76", "77"}) {
    Unit unit({{"async_type", std::int64_t{0}}});
    const std::string output = "VNWRG," + std::string(id) + ",1,8,01,0800";
    const auto dt = [&] { return real_at(unit.run(8).at(0), 4); };
    unit.run(800);
    EXPECT_EQ(unit.ask(output), with_xor(output));
    EXPECT_FLOAT_EQ(dt(), 1 / 800.0F) << "none of the time before it was written";
    unit.run(4);
    EXPECT_EQ(unit.ask(output), with_xor(output));
    EXPECT_FLOAT_EQ(dt(), 5 / 800.0F) << "written once more, three samples after a frame";
    EXPECT_FLOAT_EQ(dt(), 8 / 800.0F);
  }
}

TEST(VectorNav, APollOfIncrementsGivesThoseSinceTheLastPoll) {
  Unit unit({{"async_type", std::int64_t{30}}});
  const auto poll = [&] { return unit.ask("VNRRG,80").substr(0, 19); };
  unit.run(100);
  EXPECT_EQ(poll(), "$VNRRG,80,+0.125000");
  EXPECT_EQ(poll(), "$VNRRG,80,+0.000000");
  unit.run(40);
  EXPECT_EQ(poll(), "$VNRRG,80,+0.050000") << "streams take nothing from it";
  EXPECT_EQ(unit.run(20).at(0).substr(0, 16), "$VNDTV,+0.025000") << "nor it from them";
}

TEST(VectorNav, SettingsSurviveAResetOnceWritten) {
  Unit unit;
  unit.ask("VNWRG,07,10");
  unit.ask("VNWRG,05,921600");
  EXPECT_EQ(unit.device->uart().baud, 921600U);
  unit.ask("VNWNV");
  unit.ask("VNWRG,07,20");
  EXPECT_EQ(unit.ask("VNRST"), with_xor("VNRST"));
  EXPECT_EQ(unit.ask("VNRRG,7"), with_xor("VNRRG,7,10"));
  EXPECT_EQ(unit.device->uart().baud, 921600U);
  EXPECT_EQ(unit.ask("VNRFS"), with_xor("VNRFS"));
  EXPECT_EQ(unit.ask("VNRRG,7"), with_xor("VNRRG,7,40"));
  EXPECT_EQ(unit.device->uart().baud, 115200U);
  const std::string echo = "VNWRG,35,1,0,1,1";
  EXPECT_EQ(unit.ask(echo), with_xor(echo));
  EXPECT_EQ(unit.ask("VNRRG,35"), with_xor("VNRRG,35,1,0,1,1"));
}

TEST(VectorNav, AVn300SamplesAt400Hz) {
  Unit unit({{"model", std::string("vn-300")}});
  EXPECT_EQ(find_protocol("vectornav")
                ->product([] {
                  Settings settings(find_protocol("vectornav")->settings);
                  settings.set("model", std::string("vn-300"));
                  return settings;
                }())
                .rate_hz,
            400.0);
  EXPECT_EQ(unit.run(400).size(), 40U);
  EXPECT_EQ(unit.ask("VNRRG,1"), with_xor("VNRRG,1,VN-300S-CR"));
}

TEST(VectorNav, ACommandCutOffIsDiscarded) {
  Unit unit;
  EXPECT_EQ(unit.send("$VNRRG,0"), "");
  EXPECT_EQ(unit.send("$VNRRG,01*72\r\n"), with_xor("VNRRG,01,VN-100S-CR")) << "another begins";
  EXPECT_EQ(unit.send("$VNWRG,07,"), "");
  unit.run(1000);
  EXPECT_EQ(unit.ask("VNRRG,7"), with_xor("VNRRG,7,40"));
}

}  // namespace
}  // namespace imud
