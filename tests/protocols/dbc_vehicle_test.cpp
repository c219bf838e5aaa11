// Signals and checksums as the DBC files of vehicles have them: signs of their own, remainders, constants, sums.
#include <cmath>

#include "protocols/dbc_file.hpp"
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
      {"track_deg", -53.13010235415598},
      {"velocity_up_cm_per_s", -1200},
      {"r_E_x_km", 1000},
      {"r_E_y_m", 2e6},
      {"r_E_z_m", -3e6},
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

}  // namespace
}  // namespace imud
