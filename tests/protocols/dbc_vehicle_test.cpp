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

}  // namespace
}  // namespace imud
