// DBC files: the parser, and a device made of one.
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>

#include "core/units.hpp"
#include "protocols/signals/dbc_file.hpp"
#include "tests/protocols/dbc_unit.hpp"
#include "tests/protocols/recording.hpp"
#include "tests/support/random_changes.hpp"

namespace imud {
namespace {

// With all that a file may have: keywords in NS_, texts of several lines, a signal of each kind.
constexpr std::string_view vehicle = R"(VERSION ""

NS_ :
	BO_TX_BU_
	CM_
	BA_DEF_
	BA_
	BA_DEF_DEF_
	SIG_VALTYPE_
	SG_MUL_VAL_

BS_:

BU_: Imu Gateway

BO_ 3221225472 VECTOR__INDEPENDENT_SIG_MSG: 0 Vector__XXX
 SG_ Unused : 0|8@1+ (0,0) [0|0] "" Vector__XXX

BO_ 786 Yaw: 8 Imu
 SG_ YawRate : 7|16@0- (0.01,0) [-100|100] "deg/s" Gateway
 SG_ Ay : 16|16@1+ (0.001,-32) [0|0] "g" Gateway, Imu
 SG_ State : 40|4@1+ (1,0) [0|15] "" Gateway
 SG_ Counter : 44|4@1+ (1,0) [0|15] "" Gateway
 SG_ Crc : 48|8@1+ (1,0) [0|255] "" Gateway
 SG_ Other : 56|8@1- (1,0) [0|0] "" Gateway
BO_ 2566849022 Mux: 4 Imu
 SG_ Page M : 0|8@1+ (1,0) [0|0] "" Gateway
 SG_ RollRate m1 : 8|16@1- (1E-2,0) [0|0] "deg/s" Gateway
 SG_ PitchRate m2 : 8|16@1- (0.01,0) [0|0] "deg/s" Gateway
 SG_ Humidity m3 : 8|8@1+ (1,0) [0|0] "%" Gateway
 SG_ Level : 24|8@1+ (1,0) [0|0] "" Gateway
BO_ 513 Floats: 16 Imu
 SG_ Ax : 0|32@1- (1,0) [0|0] "m/s^2" Gateway
 SG_ Az : 64|64@1- (1,0) [0|0] "m/s^2" Gateway

CM_ "A text
BO_ 1 NotOne: 8 X
 with \" and ; in it";
CM_ SG_ 786 YawRate "BA_ is only a word";
BA_DEF_ BO_ "GenMsgCycleTime" INT 0 65535;
BA_DEF_ SG_ "GenSigStartValue" FLOAT -1E10 1E10;
BA_DEF_ BO_ "VFrameFormat" ENUM "StandardCAN","ExtendedCAN","StandardCAN_FD";
BA_DEF_DEF_ "GenMsgCycleTime" 0;
BA_DEF_DEF_ "GenSigStartValue" 0;
BA_ "GenMsgCycleTime" BO_ 786 20;
BA_ "GenMsgCycleTime" BO_ 1234 20;
BA_ "GenSigStartValue" SG_ 786 State 5;
BA_ "GenSigStartValue" SG_ 786 Other -2;
BA_ "GenSigStartValue" SG_ 2566849022 Level 7;
BA_ "VFrameFormat" BO_ 513 14;
SIG_VALTYPE_ 513 Ax : 1;
SIG_VALTYPE_ 513 Az 2;
VAL_ 786 State 5 "on" 0 "off" ;
)";

TEST(DbcFileTest, EveryDefinitionIsRead) {
  const std::vector<DbcMessage> messages = parse_dbc(vehicle);
  ASSERT_EQ(messages.size(), 4U);
  const DbcMessage &yaw = messages[1], &mux = messages[2], &floats = messages[3];
  EXPECT_EQ(yaw.name, "Yaw");
  EXPECT_EQ(yaw.line, 19U);
  EXPECT_EQ(yaw.id, 786U);
  EXPECT_FALSE(yaw.extended || yaw.fd);
  EXPECT_EQ(yaw.size, 8U);
  EXPECT_EQ(yaw.cycle, std::chrono::milliseconds(20));
  ASSERT_EQ(yaw.signals.size(), 6U);
  const DbcSignal& rate = yaw.signals[0];
  EXPECT_EQ(rate.name, "YawRate");
  EXPECT_EQ(rate.line, 20U);
  EXPECT_EQ(rate.start, 7U);
  EXPECT_EQ(rate.length, 16U);
  EXPECT_TRUE(rate.encoding.motorola && rate.encoding.format == SignalFormat::signed_integer);
  EXPECT_EQ(rate.scale, 0.01);
  EXPECT_EQ(rate.minimum, -100);
  EXPECT_EQ(rate.maximum, 100);
  EXPECT_FALSE(yaw.signals[1].encoding.motorola);
  EXPECT_EQ(yaw.signals[1].offset, -32);
  EXPECT_EQ(yaw.signals[2].initial, 5U);
  EXPECT_EQ(yaw.signals[5].initial, ~std::uint64_t{1});
  EXPECT_TRUE(mux.extended);
  EXPECT_EQ(mux.id, 0x18FF'01FEU);
  EXPECT_EQ(mux.cycle.count(), 0);
  EXPECT_TRUE(mux.signals[0].is_multiplexor);
  ASSERT_EQ(mux.signals[1].pages.size(), 1U);
  EXPECT_EQ(mux.signals[1].pages[0].first, 1U);
  EXPECT_EQ(mux.signals[1].pages[0].last, 1U);
  EXPECT_EQ(mux.signals[1].multiplexor, "Page");
  EXPECT_EQ(mux.signals[1].scale, 0.01);
  EXPECT_TRUE(mux.signals[4].pages.empty());
  EXPECT_TRUE(floats.fd);
  EXPECT_EQ(floats.signals[0].encoding.format, SignalFormat::float32);
  EXPECT_EQ(floats.signals[1].encoding.format, SignalFormat::float64);
}

// GenSigStartValue is the raw number, and the raw number of a float is a float: cantools and canmatrix apply scale
// and offset to it. The type of the signal may follow its start value.
TEST(DbcFileTest, TheStartValueOfAFloatIsAFloat) {
  const auto messages = parse_dbc(
      "BO_ 1 A: 64 X\n SG_ F : 0|32@1- (1,0) [0|0] \"\" X\n SG_ D : 64|64@1- (1,0) [0|0] \"\" X\n"
      " SG_ I : 128|32@1- (1,0) [0|0] \"\" X\n SG_ E : 192|32@1- (1,0) [0|0] \"\" X\n"
      "SIG_VALTYPE_ 1 E : 1;\nBA_DEF_DEF_ \"GenSigStartValue\" 3;\nBA_ \"GenSigStartValue\" SG_ 1 F 1.5;\n"
      "BA_ \"GenSigStartValue\" SG_ 1 D -2.25;\nSIG_VALTYPE_ 1 F : 1;\nSIG_VALTYPE_ 1 D : 2;\n");
  ASSERT_EQ(messages.size(), 1U);
  ASSERT_EQ(messages[0].signals.size(), 4U);
  EXPECT_EQ(messages[0].signals[0].initial, 0x3FC0'0000U);
  EXPECT_EQ(messages[0].signals[1].initial, 0xC002'0000'0000'0000U);
  EXPECT_EQ(messages[0].signals[2].initial, 3U);
  EXPECT_EQ(messages[0].signals[3].initial, 0x4040'0000U) << "the default";
}

// cantools, dbc.py, get_message_frame_format(): a message without the attribute has the default of its definition.
TEST(DbcFileTest, TheFrameFormatHasADefault) {
  const auto fd_of = [](const std::string& text) {
    std::vector<bool> all;
    for (const DbcMessage& message : parse_dbc("BO_ 1 A: 8 X\nBO_ 2 B: 8 X\nBO_ 3 C: 12 X\nBO_ 4 D: 12 X\n" + text +
                                               "BA_ \"VFrameFormat\" BO_ 2 0;\n" + "BA_ \"VFrameFormat\" BO_ 4 0;\n"))
      all.push_back(message.fd);
    return all;
  };
  EXPECT_EQ(fd_of("BA_DEF_DEF_ \"VFrameFormat\" \"StandardCAN_FD\";\n"), (std::vector{true, false, true, true}));
  EXPECT_EQ(fd_of("BA_DEF_DEF_ \"VFrameFormat\" 15;\n"), (std::vector{true, false, true, true}));
  EXPECT_EQ(fd_of("BA_DEF_DEF_ \"VFrameFormat\" \"StandardCAN\";\n"), (std::vector{false, false, true, true}));
}

std::string fault_of(std::string_view text) {
  try {
    parse_dbc(text);
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "";
}

TEST(DbcFileTest, AFaultHasItsLineAndWhatIsExpected) {
  const std::string head = "VERSION \"\"\n\nBO_ 1 A: 8 X\n";
  EXPECT_EQ(fault_of(head), "");
  EXPECT_EQ(fault_of("BO_ x A: 8 X"), "line 1: BO_: expected a number, but found \"x\"");
  EXPECT_EQ(fault_of("BO_ 1 A 8 X"), "line 1: BO_: expected \":\", but found \"8\"");
  EXPECT_EQ(fault_of(head + "BO_ 1 B: 8 X\n"), "line 4: BO_: a message with the identifier 1 is already defined");
  EXPECT_EQ(fault_of(" SG_ S : 0|8@1+ (1,0) [0|0] \"\" X"),
            "line 1: SG_: a signal must follow the BO_ of its message");
  EXPECT_EQ(fault_of(head + " SG_ S : 0|8@2+ (1,0) [0|0] \"\" X"),
            "line 4: SG_: expected 0+, 0-, 1+ or 1- after \"@\", but found \"2+\"");
  EXPECT_EQ(fault_of(head + " SG_ S n : 0|8@1+ (1,0) [0|0] \"\" X"),
            "line 4: SG_: expected \":\", \"M\" or \"m\" with a number, but found \"n\"");
  EXPECT_EQ(fault_of(head + " SG_ S : 0|8@1+ (1,nan) [0|0] \"\" X"),
            "line 4: SG_: expected a number, but found \"nan\"");
  EXPECT_EQ(fault_of(head + " SG_ S : 0|8@1+ (1,0"), "line 4: SG_: expected \")\", but found the end of the file");
  EXPECT_EQ(fault_of(head + " SG_ S : -1|8@1+ (1,0) [0|0] \"\" X"),
            "line 4: SG_: expected a number, but found \"-1\"");
  EXPECT_EQ(fault_of(head + "CM_ \"no\nend"), "line 4: a text in quotes does not end; add the closing quote");
  EXPECT_EQ(fault_of(head + "BA_ \"GenMsgCycleTime\" BO_ 1 -5;"),
            "line 4: GenMsgCycleTime: must be from 0 to 100000000 ms");
  for (const char* range : {"3", "-1", "3-", "3-x", "3-2", "3-4-5", "99999999999-1"})
    EXPECT_EQ(fault_of(head + "SG_MUL_VAL_ 1 S M 0-0, " + range + ";"),
              std::string("line 4: SG_MUL_VAL_: expected a range such as 0-3, but found \"") + range + "\"");
  EXPECT_EQ(fault_of(head + "SG_MUL_VAL_ 1 S M ;"), "line 4: SG_MUL_VAL_: expected a name");
  EXPECT_EQ(fault_of(head + "SIG_VALTYPE_ 1 S : 3;"),
            "line 4: SIG_VALTYPE_: the type must be 0 (integer), 1 (float) or 2 (double)");
}

// --- The device ---

class DbcDevice : public DbcUnit {
 protected:
  DbcDevice() { write(vehicle); }
};

TEST_F(DbcDevice, SendsTheMessagesThatHaveANumberEachCycleTime) {
  const auto device = protocol_.make(settings({"YawRate=rate_z_deg_per_s", "Yaw.Ay=-specific_force_y_g",
                                               "RollRate=rate_x_deg_per_s", "PitchRate=rate_y_deg_per_s"}));
  Sample sample;
  sample.rate = Vector3(1, -2, 3) * units::degree;
  sample.specific_force.y() = units::standard_gravity;
  // Yaw is 0x312, every 20 ms: 300, (-1 + 32) * 1000, State 5, Other -2. Mux has the pages 1 and 2 in turn, Level 7.
  const std::string yaw = "312#012C1879000500FE";
  EXPECT_EQ(sent(*device, sample, 4), (std::vector<std::string>{yaw + " 18FF01FE#01640007", "18FF01FE#0238FF07",
                                                                yaw + " 18FF01FE#01640007", "18FF01FE#0238FF07"}));
  const std::vector<CanMessage> messages =
      protocol_.can_messages(settings({"YawRate=rate_z_deg_per_s", "RollRate=rate_x_deg_per_s"}), 100);
  ASSERT_EQ(messages.size(), 2U);
  EXPECT_EQ(messages[0].max_frames_per_s, 50);
  EXPECT_EQ(messages[1].max_frames_per_s, 100);
}

// B is on a page of A; K depends on neither; Z is on two pages of A. cantools decodes these numbers by this file.
TEST_F(DbcDevice, MultiplexorsMayDependOnEachOther) {
  write(R"(
BO_ 256 Ext: 8 Imu
 SG_ A M : 0|4@1+ (1,0) [0|0] "" Host
 SG_ B m0M : 4|4@1+ (1,0) [0|0] "" Host
 SG_ X m0 : 8|16@1- (0.01,0) [0|0] "deg/s" Host
 SG_ Y m2 : 15|16@0- (0.01,0) [0|0] "deg/s" Host
 SG_ Z m1 : 8|24@1- (0.001,0) [0|0] "deg/s" Host
 SG_ Fixed m9 : 8|8@1+ (1,0) [0|0] "" Host
 SG_ K M : 36|4@1+ (1,0) [0|0] "" Host
 SG_ T m3 : 40|8@1+ (1,-50) [0|0] "degC" Host
 SG_ P m5 : 40|16@1+ (10,0) [0|0] "Pa" Host
SG_MUL_VAL_ 256 B A 0-0;
SG_MUL_VAL_ 256 X B 0-0;
SG_MUL_VAL_ 256 Y B 2-2;
SG_MUL_VAL_ 256 Z A 1-1, 6-6;
SG_MUL_VAL_ 256 Fixed A 9-15;
SG_MUL_VAL_ 256 T K 3-4;
SG_MUL_VAL_ 256 P K 5-5;
)");
  Sample sample;
  sample.rate = Vector3(1, -2, 3) * units::degree;
  sample.temperature_c = 25;
  sample.pressure = 101'320;
  const std::vector<std::string> signals = {"X=rate_x_deg_per_s", "Y=rate_y_deg_per_s", "Z=rate_z_deg_per_s",
                                            "T=temperature_c", "P=pressure_pa"};
  // Y comes with every second round of A.
  const std::string x = "100#00640000304B0000", y = "100#20FF3800304B0000", first_z = "100#01B80B00404B0000",
                    second_z = "100#06B80B0050942700";
  EXPECT_EQ(sent(*protocol_.make(settings(signals)), sample, 7),
            (std::vector<std::string>{x, first_z, second_z, y, first_z, second_z, x}));
  Line line(protocol_, settings({"X=rate_x_deg_per_s", "Y=rate_y_deg_per_s", "Z=rate_z_deg_per_s"}));
  Recording got;
  std::vector<Sample> samples(4, sample);
  for (std::size_t i = 0; i < samples.size(); ++i) samples[i].counter = i;
  line.feed(line.encode_all(samples), got);
  line.decoder->finish(got);
  ASSERT_EQ(got.measurements.size(), 1U) << "Y comes with the fourth message";
  EXPECT_EQ(got.measurements[0].fields, Measurement::rate);
  EXPECT_TRUE(got.measurements[0].sample.rate.isApprox(sample.rate, 1e-12));
}

TEST_F(DbcDevice, ACycleShorterThanThePeriodOfTheSamplesIsRefused) {
  const auto refusal = [&](double rate_hz) -> std::string {
    try {
      protocol_.check(settings({"YawRate=rate_z_deg_per_s"}), rate_hz);
    } catch (const std::invalid_argument& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_EQ(refusal(1000), "");
  EXPECT_EQ(refusal(50), "");
  EXPECT_EQ(refusal(49.9),
            "dbc_file: line 19: message Yaw: GenMsgCycleTime is 20 ms, but with rate_hz = 49.9 a sample comes every "
            "20.0401 ms; give rate_hz = 50 or more");
}

TEST_F(DbcDevice, ChecksumsAndCountersAreThoseOfTheProfile) {
  const auto device =
      protocol_.make(settings({"YawRate=rate_z_deg_per_s", "Counter=alive_counter"}, {"Crc=e2e_p01:0x123:both"}));
  const std::vector<std::string> lines = sent(*device, {}, 64);
  MessageChecksum checksum{.profile = ChecksumProfile::e2e_p01, .data_id = 0x123};
  int seen = 0;
  for (const std::string& line : lines) {
    if (line.empty()) continue;
    each_frame(line, [&](const Frame& frame) {
      const auto counter = std::to_integer<unsigned>(frame.bytes[5]) >> 4;
      EXPECT_EQ(counter, static_cast<unsigned>(seen % 15));
      EXPECT_EQ(std::to_integer<unsigned>(frame.bytes[6]), checksum.of(frame.bytes, 6, counter));
      ++seen;
    });
  }
  EXPECT_EQ(seen, 32);
}

TEST_F(DbcDevice, FloatsAreSentInFdFrames) {
  const auto device = protocol_.make(settings({"Ax=specific_force_x_m_per_s2", "Az=specific_force_z_m_per_s2"}));
  Sample sample;
  sample.specific_force = {1.5, 0, -1.5};
  EXPECT_EQ(sent(*device, sample, 1)[0], "201##10000C03F00000000000000000000F8BF");
}

TEST_F(DbcDevice, ItsDecoderReadsTheSameNumbers) {
  Line line(protocol_,
            settings({"YawRate=rate_z_deg_per_s", "RollRate=rate_x_deg_per_s", "PitchRate=rate_y_deg_per_s",
                      "Ay=specific_force_y_g", "Ax=specific_force_x_m_per_s2", "Az=specific_force_z_m_per_s2",
                      "Counter=sample_counter"},
                     {"Crc=h2f"}));
  std::vector<Sample> samples(4);
  for (std::size_t i = 0; i < samples.size(); ++i) {
    samples[i].time.ns = static_cast<std::int64_t>(i) * 20'000'000;
    samples[i].counter = i;
    samples[i].rate = Vector3(1, -2, 3 + static_cast<double>(i)) * units::degree;
    samples[i].specific_force = {1.5, 0.25 * units::standard_gravity, -9.75};
  }
  Recording got;
  line.feed(line.encode_all(samples), got);
  line.decoder->finish(got);
  ASSERT_EQ(got.measurements.size(), 4U);
  for (std::size_t i = 0; i < 4; ++i) {
    const Measurement& one = got.measurements[i];
    // The first sample has only one page of the rates.
    const std::uint32_t always = Measurement::specific_force | Measurement::counter;
    EXPECT_EQ(one.fields, always | (i > 0 ? Measurement::rate : 0U)) << i;
    EXPECT_EQ(one.sample.counter, i);
    EXPECT_NEAR(one.sample.rate.z(), samples[i].rate.z(), 1e-12);
    if (i > 0) {
      EXPECT_TRUE(one.sample.rate.isApprox(samples[i].rate, 1e-12)) << one.sample.rate.transpose();
    }
    EXPECT_TRUE(one.sample.specific_force.isApprox(samples[i].specific_force, 1e-12));
  }
}

TEST_F(DbcDevice, AFaultySettingIsRefusedWithItsRemedy) {
  const std::string rate = "YawRate=rate_z_deg_per_s";
  EXPECT_EQ(refusal({rate}), "");
  EXPECT_EQ(refusal({}), "signals: give at least one SIGNAL=QUANTITY");
  EXPECT_EQ(refusal({"YawRate"}), "signals: \"YawRate\": give SIGNAL=QUANTITY");
  EXPECT_EQ(refusal({rate}, {"Crc"}), "checksums: \"Crc\": give SIGNAL=KIND");
  EXPECT_EQ(refusal({rate, rate}), "signals: \"YawRate\" is listed twice");
  EXPECT_EQ(refusal({"Yaw.Rate=rate_z_deg_per_s"}),
            "signals: unknown signal \"Yaw.Rate\"; the signals are VECTOR__INDEPENDENT_SIG_MSG.Unused, Yaw.YawRate, "
            "Yaw.Ay, Yaw.State, Yaw.Counter, Yaw.Crc, Yaw.Other, Mux.Page, Mux.RollRate, Mux.PitchRate, "
            "Mux.Humidity, Mux.Level, Floats.Ax, Floats.Az");
  EXPECT_EQ(refusal({"YawRate=rate_z_deg"}).substr(0, 89),
            "signals: message Yaw, line 19: YawRate: unknown quantity \"rate_z_deg\"; the quantities are");
  EXPECT_EQ(refusal({rate}, {"Crc=crc8"}).substr(0, 49), "checksums: \"Crc=crc8\": the kind must be j1850, h2");
  EXPECT_EQ(refusal({rate}, {"Crc=e2e_p02:000102030405060708090a0b0c0d0e0f"}),
            "signals: message Yaw, line 19: Crc: its profile needs a signal that is alive_counter");
  EXPECT_EQ(refusal({"Unused=rate_x_deg_per_s"}),
            "dbc_file: line 16: message VECTOR__INDEPENDENT_SIG_MSG: the identifier is out of range");
  write("BO_ 1 A: 9 X\n SG_ S : 0|8@1+ (1,0) [0|0] \"\" X\n");
  EXPECT_EQ(refusal({"S=status"}), "dbc_file: line 1: message A: no CAN frame has 9 data bytes");
  write("BO_ 1 A: 8 X\n SG_ S : 60|8@1+ (1,0) [0|0] \"\" X\n");
  EXPECT_EQ(refusal({"S=status"}), "signals: message A, line 1: S: exceeds the 8 bytes of its message");
  write(
      "BO_ 1 A: 8 X\n SG_ M M : 0|8@1+ (1,0) [0|0] \"\" X\n SG_ N m1M : 8|8@1+ (1,0) [0|0] \"\" X\n"
      " SG_ S m1 : 16|8@1+ (1,0) [0|0] \"\" X\n");
  EXPECT_EQ(refusal({"S=status"}), "signals: message A, line 1: S: its message has no multiplexor")
      << "which of the two?";
  write("BO_ 1 A: 8 X\n SG_ S : 0|8@1+ (1,0) [0|0] \"\" X\nBO_ 2 B: 8 X\n SG_ S : 0|8@1+ (1,0) [0|0] \"\" X\n");
  EXPECT_EQ(refusal({"S=status"}), "signals: \"S\" is a signal of A and of B; give MESSAGE.SIGNAL");
  EXPECT_EQ(refusal({"B.S=status"}), "");
  write("BO_ x");
  EXPECT_EQ(refusal({"S=status"}), "dbc_file: PATH: line 1: BO_: expected a number, but found \"x\"");
  std::filesystem::remove(path_);
  EXPECT_EQ(refusal({"S=status"}), "dbc_file: PATH: no such file; give the path of a DBC file");
  path_ = "";
  EXPECT_EQ(refusal({"S=status"}), "dbc_file: give the path of the DBC file that has the signals");
}

// Random changes of the file above. The environment variable IMUD_FUZZ_INPUTS sets their number.
TEST(DbcFuzz, AnyBytesDoNoHarm) {
  const char* wanted = std::getenv("IMUD_FUZZ_INPUTS");
  const long inputs = wanted != nullptr ? std::atol(wanted) : 20'000;
  std::mt19937_64 random(2);
  constexpr std::string_view pieces[] = {"0",
                                         "9",
                                         "-",
                                         ".",
                                         "|",
                                         "@",
                                         " ",
                                         "\n",
                                         "\"",
                                         "m1M",
                                         "7-5, 99999999999",
                                         "\nSG_MUL_VAL_ 2566849022 RollRate Page 0-3, 5-5;",
                                         "\nSG_MUL_VAL_ 2566849022 Page RollRate 1-1;"};
  long accepted = 0, codecs = 0;
  for (long n = 0; n < inputs; ++n) {
    std::string text(vehicle);
    for (std::size_t k = 1 + random() % 4; k > 0 && !text.empty(); --k) change_randomly(text, 20, pieces, random);
    std::vector<DbcMessage> messages;
    try {
      messages = parse_dbc(text);
      ++accepted;
    } catch (const std::invalid_argument&) {
    }
    for (const DbcMessage& message : messages) {
      std::vector<CanSignal> signals;
      for (const DbcSignal& signal : message.signals)
        signals.push_back({signal.name, signal.start, signal.length, signal.encoding, signal.scale, signal.offset,
                           signal.is_multiplexor ? "" : "rate_x_deg_per_s", nullptr, signal.initial, signal.minimum,
                           signal.maximum, signal.pages, signal.multiplexor});
      try {
        const CanSignalCodec codec(std::min<std::size_t>(message.size, 64), signals);
        std::vector<std::byte> bytes(codec.size());
        Sample sample;
        sample.rate.x() = static_cast<double>(random()) * 1e-12;
        codec.encode({sample}, random(), bytes);
        for (std::byte& byte : bytes) byte ^= static_cast<std::byte>(random());
        ReadBack read;
        static_cast<void>(codec.decode(bytes, read));
        ++codecs;
      } catch (const std::invalid_argument&) {
      }
    }
  }
  EXPECT_GT(accepted, inputs / 4);
  EXPECT_GT(codecs, inputs / 2);
}

}  // namespace
}  // namespace imud
