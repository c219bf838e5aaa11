// Signals and checksums as the DBC files of vehicles have them: signs of their own, remainders, constants, sums.
#include <cmath>

#include "protocols/signals/dbc_file.hpp"
#include "tests/protocols/dbc_unit.hpp"

namespace imud {
namespace {

using Lines = std::vector<std::string>;

Sample turning(double deg_per_s) {
  Sample sample;
  sample.rate.z() = deg_per_s * units::degree;
  return sample;
}

Sample heading(double degrees) {
  Sample sample;
  sample.q_LP = exp(Vector3(0, 0, degrees * units::degree));
  return sample;
}

// Bremse_5 of commaai/opendbc at 7343a66, opendbc/dbc/vw_pq.dbc.
constexpr std::string_view brake = R"(
BO_ 1192 Bremse_5: 8 XXX
 SG_ Vorzeichen_Gierrate______ : 15|1@1+ (1,0) [0|0] "" XXX
 SG_ Gierratenfehler : 14|1@1+ (1,0) [0|0] "" XXX
 SG_ Gierrate : 0|14@1+ (0.01,0) [0|100] "deg/sek" XXX
)";
const Lines signed_rate = {"Gierrate=abs(rate_z_deg_per_s)", "Vorzeichen_Gierrate______=sign(rate_z_deg_per_s)"};

TEST_F(DbcUnit, SignAndMagnitudeAreTwoSignals) {
  write(brake);
  const auto device = protocol_.make(settings(signed_rate));
  EXPECT_EQ(sent(*device, turning(-20), 1)[0], "4A8#D087000000000000");
  EXPECT_EQ(sent(*device, turning(20), 1)[0], "4A8#D007000000000000");
  EXPECT_EQ(sent(*device, turning(0), 1)[0], "4A8#0000000000000000");
  EXPECT_EQ(device->counts()[0], 0U);
  EXPECT_EQ(sent(*device, turning(-200), 1)[0], "4A8#10A7000000000000");
  EXPECT_EQ(device->counts()[0], 1U) << "the magnitude is limited to 100";
  const auto other =
      protocol_.make(settings({"Gierrate=abs(rate_z_deg_per_s)", "Gierratenfehler=sign(-rate_z_deg_per_s)"}));
  EXPECT_EQ(sent(*other, turning(20), 1)[0], "4A8#D047000000000000") << "a sign that is 1 for positive numbers";
}

TEST_F(DbcUnit, SignAndMagnitudeAreReadBackAsOneNumber) {
  write(brake);
  Line line(protocol_, settings(signed_rate));
  Recording got;
  line.feed(line.encode_all(std::vector{turning(-20), turning(20)}), got);
  line.decoder->finish(got);
  ASSERT_EQ(got.measurements.size(), 2U);
  EXPECT_NEAR(got.measurements[0].sample.rate.z(), -20 * units::degree, 1e-12);
  EXPECT_NEAR(got.measurements[1].sample.rate.z(), 20 * units::degree, 1e-12);

  Line half(protocol_, settings({"Gierrate=abs(rate_z_deg_per_s)"}));
  Recording nothing;
  half.feed(half.encode_all(std::vector{turning(-20)}), nothing);
  half.decoder->finish(nothing);
  EXPECT_EQ(nothing.measurements.size(), 0U) << "a magnitude alone is no rate";
}

TEST_F(DbcUnit, ANumberBeyondItsSignalIsCounted) {
  write(brake);
  ASSERT_EQ(protocol_.counters.size(), 1U);
  EXPECT_EQ(protocol_.counters[0].key, "saturated_signals");
  const auto device = protocol_.make(settings({"Gierrate=rate_z_deg_per_s"}));
  ASSERT_EQ(device->counts().size(), 1U);
  static_cast<void>(sent(*device, turning(-0.005), 1));
  static_cast<void>(sent(*device, turning(100.005), 1));
  EXPECT_EQ(device->counts()[0], 0U) << "within half an LSB";
  static_cast<void>(sent(*device, turning(-0.0051), 1));
  EXPECT_EQ(device->counts()[0], 1U);
  static_cast<void>(sent(*device, turning(100.0051), 1));
  EXPECT_EQ(device->counts()[0], 2U);
  EXPECT_EQ(sent(*device, turning(std::nan("")), 1)[0], "4A8#0000000000000000");
  EXPECT_EQ(device->counts()[0], 3U);
  EXPECT_EQ(sent(*device, turning(-20), 3).size(), 3U);
  EXPECT_EQ(device->counts()[0], 6U) << "one for each message";
}

TEST_F(DbcUnit, ARemainderWraps) {
  write("BO_ 1 A: 8 X\n SG_ Heading : 0|32@1+ (0.001,0) [0|360] \"deg\" X\n SG_ Year : 32|8@1+ (1,0) [0|0] \"\" X\n");
  const auto device = protocol_.make(settings({"Heading=yaw_deg%360", "Year=utc_year%100"}));
  const auto sent_for = [&](double degrees) { return sent(*device, heading(degrees), 1)[0].substr(4, 8); };
  EXPECT_EQ(sent_for(-60), "E0930400") << "300000";
  EXPECT_EQ(sent_for(-179), "08C30200") << "181000";
  EXPECT_EQ(sent_for(90), "905F0100");
  EXPECT_EQ(sent_for(-0.0004), "00000000") << "360.000 is 0";
  EXPECT_EQ(sent_for(-0.0006), "3F7E0500") << "359.999";
  Sample dated;
  dated.navigation.is_known = true;
  dated.navigation.gps_ns = 1'447'934'400'000'000'000 + 18'000'000'000;
  EXPECT_EQ(sent(*device, dated, 1)[0].substr(12, 2), "19") << "2025";
  EXPECT_EQ(device->counts()[0], 0U);
  EXPECT_EQ(refusal({"Heading=yaw_deg%0.001"}),
            "signals: message A, line 1: Heading: the modulus must be more than the scale of the signal");
}

TEST_F(DbcUnit, ConstantsAreInTheUnitOfTheSignal) {
  write(
      "BO_ 1 A: 8 X\n SG_ S : 0|8@1+ (0.5,-10) [0|0] \"\" X\n SG_ T : 15|8@0- (1,0) [0|0] \"\" X\n"
      " SG_ F : 32|32@1- (1,0) [0|0] \"\" X\nSIG_VALTYPE_ 1 F : 1;\n"
      "BO_ 2 B: 2 X\n SG_ M M : 0|8@1+ (1,0) [0|0] \"\" X\n SG_ P m7 : 8|8@1+ (1,0) [0|0] \"\" X\n");
  const auto device = protocol_.make(settings({"S=-2.5", "T=-1", "F=1.5", "P=3"}));
  EXPECT_EQ(sent(*device, {}, 1)[0], "001#0FFF00000000C03F 002#0703");
  const auto multiplexor = protocol_.make(settings({"M=7"}));
  EXPECT_EQ(sent(*multiplexor, {}, 1)[0], "002#0700");
  EXPECT_EQ(refusal({"S=0.25"}), "signals: message A, line 1: S: 0.25 is not a value of the signal");
  EXPECT_EQ(refusal({"S=117.5"}), "");
  EXPECT_EQ(refusal({"S=118"}), "signals: message A, line 1: S: 118 is not a value of the signal");
  EXPECT_EQ(refusal({"S=-10.5"}), "signals: message A, line 1: S: -10.5 is not a value of the signal");
  EXPECT_EQ(refusal({"S=inf"}).substr(0, 62), "signals: message A, line 1: S: unknown quantity \"inf\"; the qua");
}

TEST_F(DbcUnit, AFaultyFormIsRefused) {
  write(brake);
  for (const char* form :
       {"abs(rate_z_deg_per_s", "abs()", "sign(status)", "status%2", "time_s%1", "yaw_deg%", "yaw_deg%0",
        "yaw_deg%-1", "yaw_deg%nan", "%360", "abs(yaw_deg)%90", "abs(abs(yaw_deg))", "1x", "--1"}) {
    const std::string refused = refusal({std::string("Gierrate=") + form});
    EXPECT_TRUE(refused.starts_with(std::string("signals: message Bremse_5, line 2: Gierrate: unknown quantity \"") +
                                    form + "\"; the quantities are "))
        << refused.substr(0, 100);
    EXPECT_TRUE(refused.ends_with("give a quantity, abs(QUANTITY), sign(QUANTITY), QUANTITY%MODULUS or a number"))
        << form;
  }
}

// Files have limits as rounded decimals: open_actuator.dbc of cantools' tests has -8 to 8 with the scale 0.0166667.
TEST_F(DbcUnit, ALimitThatIsRoundedIsItsNumber) {
  write("BO_ 1 A: 2 X\n SG_ S : 0|10@1- (0.0166667,0) [-8|8] \"\" X\n SG_ L : 10|6@1+ (10,0) [0|25] \"\" X\n");
  const auto device = protocol_.make(settings({"S=rate_z_deg_per_s", "L=rate_x_deg_per_s"}));
  Sample sample = turning(-20);
  sample.rate.x() = 100 * units::degree;
  EXPECT_EQ(sent(*device, sample, 1)[0], "001#200A") << "-480, and 2 for the limit of 2.5";
}

// commaai/opendbc at 7343a66, opendbc/can/tests/test_checksums.py, test_honda_checksum: "known correct checksums" of
// the messages with the counters 0 to 3.
TEST_F(DbcUnit, HondasChecksumsAreThoseOfItsTest) {
  std::string text;
  for (const char* message : {"BO_ 829 LKAS_HUD: 5 ADAS\n", "BO_ 2147496922 LKAS_HUD_A: 5 ADAS\n"})
    text += std::string(message) +
            " SG_ LKAS_READY : 0|1@0+ (1,0) [0|127] \"\" BDY\n SG_ LKAS_STATE_CHANGE : 6|1@0+ (1,0) [0|1] \"\" XXX\n"
            " SG_ SOLID_LANES : 10|1@0+ (1,0) [0|1] \"\" BDY\n SG_ STEERING_REQUIRED : 8|1@0+ (1,0) [0|1] \"\" BDY\n"
            " SG_ CHECKSUM : 35|4@0+ (1,0) [0|15] \"\" BDY\n SG_ COUNTER : 37|2@0+ (1,0) [0|3] \"\" BDY\n";
  write(text);
  Lines signals, checksums;
  for (const std::string message : {"LKAS_HUD.", "LKAS_HUD_A."}) {
    for (const char* one :
         {"LKAS_READY=1", "LKAS_STATE_CHANGE=1", "SOLID_LANES=1", "STEERING_REQUIRED=1", "COUNTER=alive_counter"})
      signals.push_back(message + one);
    checksums.push_back(message + "CHECKSUM=honda");
  }
  Line line(protocol_, settings(signals, checksums));
  const auto device = protocol_.make(settings(signals, checksums));
  EXPECT_EQ(sent(*device, {}, 5), (Lines{"000033DA#4105000004 33D#410500000B", "000033DA#4105000013 33D#410500001A",
                                         "000033DA#4105000022 33D#4105000029", "000033DA#4105000031 33D#4105000038",
                                         "000033DA#4105000004 33D#410500000B"}));
}

// What the functions of commaai/opendbc at 7343a66 return for the bytes 12 34 56 78 90 AB CD EF; Toyota's second is
// the message of its test_packer_parser.py, make_can_msg("ACC_CONTROL").
TEST(VehicleChecksum, AgreesWithOpendbc) {
  const struct {
    const char* kind;
    std::uint32_t id;
    bool extended;
    std::size_t at;
    bool is_upper_half;
    std::uint16_t sum;
    bool is_empty = false;
  } cases[] = {
      {"toyota", 0x2E4, false, 7, false, 0x0A},   {"toyota", 835, false, 7, false, 'N', true},
      {"honda", 0x33D, false, 7, false, 0xC},     {"honda", 0x12F8BFA7, true, 7, false, 0xD},
      {"subaru", 0x122, false, 0, false, 0x1C},   {"tesla", 0x488, false, 7, false, 0xA8},
      {"tesla", 0x370, false, 0, false, 0x6C},    {"psa", 0x3AD, false, 7, false, 0x2},
      {"psa:7", 0x38D, false, 4, true, 0x8},      {"xor", 0x1A0, false, 0, false, 0x03},
      {"xor:0x27", 0x324, false, 0, false, 0x24}, {"j1850", 0x2FA, false, 7, false, 0x19},
      {"sum:0xEA", 0x2E4, false, 7, false, 0x06},
  };
  for (const auto& one : cases) {
    auto checksum = parse_checksum(one.kind);
    ASSERT_TRUE(checksum) << one.kind;
    checksum->begin_with(one.id, one.extended, 8);
    checksum->is_upper_half = one.is_upper_half;
    std::vector<std::byte> bytes;
    for (const int byte : {0x12, 0x34, 0x56, 0x78, 0x90, 0xAB, 0xCD, 0xEF})
      bytes.push_back(static_cast<std::byte>(one.is_empty ? 0 : byte));
    EXPECT_EQ(checksum->of(bytes, one.at, 0), one.sum) << one.kind << ' ' << one.id;
    // Its own bits do not count, and one bit of any other does.
    const unsigned own = checksum->bits() == 8 ? 0xFFU : one.is_upper_half ? 0xF0U : 0x0FU;
    for (std::size_t bit = 0; bit < 64; ++bit) {
      std::vector<std::byte> changed = bytes;
      changed[bit / 8] ^= static_cast<std::byte>(1U << bit % 8);
      const bool is_own = bit / 8 == one.at && (own >> bit % 8 & 1U) != 0;
      EXPECT_EQ(checksum->of(changed, one.at, 0) == one.sum, is_own) << one.kind << ", bit " << bit;
    }
  }
  for (const char* text : {"toyota:1", "honda:", "sum:256", "sum:0x", "sum:1:2", "xor:-1", "psa:x", "tesla :"})
    EXPECT_EQ(parse_checksum(text).has_value(), std::string_view(text) == "honda:") << text;
}

TEST_F(DbcUnit, AHalfByteHoldsAChecksumOfFourBits) {
  const auto place = [&](const char* signal) {
    write(std::string("BO_ 2 A: 2 X\n SG_ C : ") + signal + " (1,0) [0|0] \"\" X\n");
    return refusal({"C=1"}).empty() ? refusal({}, {"C=honda"}) : "not a signal";
  };
  for (const char* good : {"0|4@1+", "4|4@1+", "11|4@0+", "15|4@0+"}) EXPECT_EQ(place(good), "") << good;
  for (const char* bad : {"1|4@1+", "0|8@1+", "12|3@1+", "14|4@0+"})
    EXPECT_EQ(place(bad), "signals: message A, line 1: C: must be the upper or the lower half of a byte") << bad;
  write("BO_ 2 A: 2 X\n SG_ C : 12|4@1+ (1,0) [0|0] \"\" X\n");
  EXPECT_EQ(sent(*protocol_.make(settings({}, {"C=honda"})), {}, 1)[0], "002#0060") << "8 - 2, above";
}

TEST_F(DbcUnit, LongNamesAreThoseOfTheSymbols) {
  write(
      "BO_ 1 Message_of_32_characters_0123456: 8 X\n SG_ Mux M : 0|8@1+ (1,0) [0|0] \"\" X\n"
      " SG_ Short m3 : 8|8@1- (1,0) [0|0] \"\" X\n SG_ Other m3 : 16|8@1- (1,0) [0|0] \"\" X\n"
      "BA_ \"SystemMessageLongSymbol\" BO_ 1 \"Message_of_32_characters_0123456789\";\n"
      "BA_ \"SystemSignalLongSymbol\" SG_ 1 Short \"Short_and_the_rest_of_its_long_name\";\n"
      "BA_ \"SystemSignalLongSymbol\" SG_ 1 Mux \"Mux_and_the_rest_of_its_long_name\";\n"
      "BA_ \"SystemSignalLongSymbol\" SG_ 2 Short \"nothing\";\nBA_ \"GenSigStartValue\" SG_ 1 Other -1;\n"
      "SG_MUL_VAL_ 1 Short Mux 3-3;\n");
  const std::string rate = "=rate_z_deg_per_s";
  for (const std::string name :
       {"Short_and_the_rest_of_its_long_name", "Short", "Message_of_32_characters_0123456789.Short",
        "Message_of_32_characters_0123456.Short_and_the_rest_of_its_long_name"})
    EXPECT_EQ(sent(*protocol_.make(settings({name + rate})), turning(-20), 1)[0], "001#03ECFF0000000000") << name;
  EXPECT_EQ(refusal({"Shor" + rate}),
            "signals: unknown signal \"Shor\"; the signals are "
            "Message_of_32_characters_0123456789.Mux_and_the_rest_of_its_long_name, "
            "Message_of_32_characters_0123456789.Short_and_the_rest_of_its_long_name, "
            "Message_of_32_characters_0123456789.Other");
}

// Two multiplexors that have each other's name as the long one.
TEST(DbcFileTest, AMultiplexorHasItsLongNameOnce) {
  const auto messages = parse_dbc(
      "BO_ 1 A: 8 X\n SG_ P M : 0|8@1+ (1,0) [0|0] \"\" X\n SG_ Q m1M : 8|8@1+ (1,0) [0|0] \"\" X\n"
      " SG_ R m2 : 16|8@1+ (1,0) [0|0] \"\" X\n SG_ S m3 : 24|8@1+ (1,0) [0|0] \"\" X\n"
      "BA_ \"SystemSignalLongSymbol\" SG_ 1 P \"Q\";\nBA_ \"SystemSignalLongSymbol\" SG_ 1 Q \"P\";\n"
      "SG_MUL_VAL_ 1 Q P 1-1;\nSG_MUL_VAL_ 1 R P 2-2;\nSG_MUL_VAL_ 1 S Q 3-3;\n");
  ASSERT_EQ(messages.size(), 1U);
  ASSERT_EQ(messages[0].signals.size(), 4U);
  const auto& signals = messages[0].signals;
  EXPECT_EQ(signals[0].name, "Q");
  EXPECT_EQ(signals[1].name, "P");
  EXPECT_EQ(signals[1].multiplexor, "Q");
  EXPECT_EQ(signals[2].multiplexor, "Q");
  EXPECT_EQ(signals[3].multiplexor, "P");
}

// opendbc's vw_pq.dbc: "SG_ MO2_Mp_Code m : 6|2@1+".
TEST(DbcFileTest, ALoneMarkOfAMultiplexedSignalIsNoPage) {
  const auto messages = parse_dbc(
      "BO_ 648 Motor_2: 8 Motor\n SG_ MO2_Mp_Code m : 6|2@1+ (1,0) [0|3] \"\" Gateway\n"
      " SG_ MO2_Getr_Code m2 : 0|6@1+ (1,0) [0|63] \"\" Gateway\n");
  ASSERT_EQ(messages.size(), 1U);
  ASSERT_EQ(messages[0].signals.size(), 2U);
  EXPECT_FALSE(messages[0].signals[0].is_multiplexor);
  EXPECT_TRUE(messages[0].signals[0].pages.empty());
  EXPECT_EQ(messages[0].signals[1].pages.size(), 1U);
}

TEST(MeasuredQuantities, FollowFromTheSample) {
  Sample sample = heading(90);  // x points east
  sample.specific_force = {1, 2, 3};
  sample.navigation.is_known = true;
  sample.navigation.v_L = {3, -4, 12};
  sample.navigation.r_E = {1e6, 2e6, -3e6};
  sample.navigation.gps_ns = 1'420'000'000'123'456'789;  // 2025-01-04 04:26:22.123456789 UTC
  const struct {
    const char* name;
    double value;
  } cases[] = {
      {"speed_m_per_s", 13},
      {"ground_speed_km_per_h", 18},
      {"ground_speed_kt", 5 / (1852.0 / 3600)},
      {"ground_speed_kn", 5 / (1852.0 / 3600)},
      {"speed_km_per_s", 0.013},
      {"track_deg", -53.13010235415598},
      {"velocity_up_cm_per_s", -1200},
      {"r_E_x_km", 1000},
      {"r_E_y_m", 2e6},
      {"r_E_z_m", -3e6},
      {"position_north_m", -3e6},
      {"position_east_km", 2000},
      {"position_down_m", 6'378'137.0 - 1e6},  // from latitude and longitude 0
      {"-position_down_m", 1e6 - 6'378'137.0},
      {"acceleration_x_m_per_s2", 1},
      {"acceleration_z_m_per_s2", 3 + units::standard_gravity},
      {"sigma_LP_3", std::tan(22.5 * units::degree)},
      {"sigma_LP_1", 0},
      {"yaw_arcsec", 324000},
      {"day_of_year", 4},
      {"time_of_day_s", 15982.123456789},
      {"unix_time_s", 1735964782.123456789},
      {"rate_x_rpm", 0},
  };
  for (const auto& [name, value] : cases) {
    const auto found = find_measured(name);
    ASSERT_TRUE(found) << name;
    const double got = (found->quantity->get({sample}) - found->offset) / found->factor;
    EXPECT_NEAR(got, value, 1e-9 * std::max(1.0, std::abs(value))) << name;
  }
}

// Calculated with numpy from the three rotations about north, east and down, and from the matrix that exchanges x and
// y and negates z. Without yaw and with small angles the roll about right is the pitch, and the pitch the roll.
TEST(MeasuredQuantities, HaveTheAnglesOfRightForwardUp) {
  const struct {
    double yaw, pitch, roll, yaw_RFU, pitch_RFU, roll_RFU;
  } cases[] = {
      {100, 20, -30, -111.170229433079, -28.024320673605, 22.795877258858},
      {-150.25, -20.5, 30.75, 138.480713637347, 28.614498571663, -23.511444659008},
      {90, 0, 0, -90, 0, 0},
      {0, 5, 0, 0, 0, 5},
      {0, 0, 7, 0, 7, 0},
  };
  for (const auto& one : cases) {
    Sample sample;
    const Matrix3 dcm_PL =
        dcm_from_yaw_pitch_roll(one.yaw * units::degree, one.pitch * units::degree, one.roll * units::degree);
    sample.q_LP = Quaternion(Matrix3(dcm_PL.transpose()));
    const auto in_deg = [&](const char* name) {
      const auto found = find_measured(name);
      return found ? found->quantity->get({sample}) / found->factor : std::nan("");
    };
    EXPECT_NEAR(in_deg("yaw_RFU_deg"), one.yaw_RFU, 1e-9);
    EXPECT_NEAR(in_deg("pitch_RFU_deg"), one.pitch_RFU, 1e-9);
    EXPECT_NEAR(in_deg("roll_RFU_deg"), one.roll_RFU, 1e-9);
  }
}

}  // namespace
}  // namespace imud
