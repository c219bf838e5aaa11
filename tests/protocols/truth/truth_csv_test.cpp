// Truth as CSV: columns by name, every cause, and times.
#include <gtest/gtest.h>

#include <algorithm>
#include <stdexcept>

#include "core/attitude.hpp"
#include "protocols/quantities/columns.hpp"
#include "protocols/truth_format.hpp"
#include "tests/support/decode_truth.hpp"

namespace imud {
namespace {

const std::string required = "time_ns,sigma_BN_1,sigma_BN_2,sigma_BN_3,omega_BN_B_x,omega_BN_B_y,omega_BN_B_z";

Settings csv_settings(std::initializer_list<std::pair<std::string_view, SettingValue>> values = {}) {
  Settings settings(find_truth_format("csv")->settings);
  for (const auto& [key, value] : values) settings.set(key, value);
  return settings;
}

class CsvTruth : public testing::Test {
 protected:
  TruthResult decode(std::string_view text) {
    return decode_truth(*decoder_, std::as_bytes(std::span(text)), truth_);
  }
  void make(const Settings& settings) { decoder_ = find_truth_format("csv")->make(settings); }

  std::unique_ptr<TruthDecoder> decoder_ = find_truth_format("csv")->make(csv_settings());
  Truth truth_;
};

TEST_F(CsvTruth, ColumnsInAnyOrderAndOthersBetween) {
  // Values of row 1 of the reference vectors (Basilisk imuSensor), two of its columns and one more among them.
  ASSERT_EQ(decode("gravity,omega_BN_B_z,omega_BN_B_y,omega_BN_B_x,sigma_BN_3,sigma_BN_2,sigma_BN_1,time_ns,"
                   "TotalAccumDVBdy_x,r_BN_N_x,r_BN_N_y,r_BN_N_z,v_BN_N_x,v_BN_N_y,v_BN_N_z,"
                   "omegaDot_BN_B_x,omegaDot_BN_B_y,omegaDot_BN_B_z,nonConservativeAccelpntB_B_x,"
                   "nonConservativeAccelpntB_B_y,nonConservativeAccelpntB_B_z,"
                   "TotalAccumDV_BN_B_x,TotalAccumDV_BN_B_y,TotalAccumDV_BN_B_z\r\n"),
            TruthResult::no_state);
  ASSERT_EQ(decode("text,0.23903614609429373,-0.23495882141378868,0.060497856381300862,0.55069832646691375,"
                   "-0.35548949692287335,0.62513809065609693,50000000,,"
                   "6778136.9894980472,270.79989925530771,270.80065997848953,"
                   "-0.41955628616426793,5415.9954313369726,5416.0263118895782,"
                   "0.20987138812993258,0.022310636213174546,0.41256445508051376,"
                   "0.51299084776695647,-0.2996963012543527,0.183845735063106,"
                   "0.025274470327054058,-0.015132058264159191,0.0069714232669666962\r\n"),
            TruthResult::ok);
  EXPECT_EQ(truth_.time.ns, 50000000);
  EXPECT_EQ(truth_.omega_BN_B, Vector3(0.060497856381300862, -0.23495882141378868, 0.23903614609429373));
  EXPECT_EQ(truth_.q_NB.coeffs(),
            quaternion_from_mrp({0.62513809065609693, -0.35548949692287335, 0.55069832646691375}).coeffs());
  EXPECT_EQ(truth_.r_BN_N, Vector3(6778136.9894980472, 270.79989925530771, 270.80065997848953));
  EXPECT_EQ(truth_.v_BN_N, Vector3(-0.41955628616426793, 5415.9954313369726, 5416.0263118895782));
  EXPECT_TRUE(truth_.has_angular_acceleration && truth_.has_specific_force);
  EXPECT_EQ(truth_.omegaDot_BN_B, Vector3(0.20987138812993258, 0.022310636213174546, 0.41256445508051376));
  EXPECT_EQ(truth_.specific_force_B, Vector3(0.51299084776695647, -0.2996963012543527, 0.183845735063106));
  EXPECT_EQ(truth_.accumulated_dv, AccumulatedDv::inertial);
  EXPECT_EQ(truth_.accumulated_dv_B, Vector3(0.025274470327054058, -0.015132058264159191, 0.0069714232669666962));
}

TEST_F(CsvTruth, MayHaveATemperature) {
  ASSERT_EQ(decode(required + ",temperature_c"), TruthResult::no_state);
  ASSERT_EQ(decode("0,0,0,0,0,0,0,-12.5"), TruthResult::ok);
  EXPECT_TRUE(truth_.has_temperature);
  EXPECT_EQ(truth_.temperature_c, -12.5);
  EXPECT_EQ(decode("1,0,0,0,0,0,0,nan"), TruthResult::not_finite);
  EXPECT_EQ(decode("1,0,0,0,0,0,0,20000"), TruthResult::out_of_range);
  EXPECT_EQ(decode("1,0,0,0,0,0,0,warm"), TruthResult::bad_number);
}

TEST_F(CsvTruth, AccumulatedDvIsWhatTheSettingSays) {
  for (const auto& [word, kind] : {std::pair{"inertial", AccumulatedDv::inertial},
                                   {"body_sum", AccumulatedDv::body_sum},
                                   {"none", AccumulatedDv::none}}) {
    make(csv_settings({{"accumulated_dv", std::string(word)}}));
    ASSERT_EQ(decode(required + ",TotalAccumDV_BN_B_x,TotalAccumDV_BN_B_y,TotalAccumDV_BN_B_z"),
              TruthResult::no_state);
    ASSERT_EQ(decode("0,0,0,0,0,0,0,1,2,3"), TruthResult::ok);
    EXPECT_EQ(truth_.accumulated_dv, kind);
    EXPECT_EQ(truth_.accumulated_dv_B, kind == AccumulatedDv::none ? Vector3(0, 0, 0) : Vector3(1, 2, 3));
  }
  EXPECT_THROW(csv_settings({{"accumulated_dv", std::string("sometimes")}}), std::invalid_argument);
}

TEST_F(CsvTruth, AGroupCountsOnlyIfItIsWhole) {
  const auto decode_with = [this](const std::string& columns, const std::string& values) {
    return decode(required + columns) == TruthResult::no_state ? decode("0,0,0,0,0,0,0" + values)
                                                               : TruthResult::no_columns;
  };
  ASSERT_EQ(decode_with("", ""), TruthResult::ok);
  EXPECT_FALSE(truth_.has_angular_acceleration || truth_.has_specific_force);
  EXPECT_EQ(truth_.accumulated_dv, AccumulatedDv::none);
  ASSERT_EQ(decode_with(",omegaDot_BN_B_x,omegaDot_BN_B_z,r_BN_N_x,nonConservativeAccelpntB_B_y,TotalAccumDV_BN_B_z",
                        ",1,2,3,4,5"),
            TruthResult::ok);
  EXPECT_FALSE(truth_.has_angular_acceleration || truth_.has_specific_force);
  EXPECT_EQ(truth_.accumulated_dv, AccumulatedDv::none);
  EXPECT_TRUE(truth_.r_BN_N.isZero() && truth_.omegaDot_BN_B.isZero() && truth_.specific_force_B.isZero());
}

TEST_F(CsvTruth, RowsWithoutTheirColumns) {
  EXPECT_EQ(decode("0,0,0,0,0,0,0"), TruthResult::no_columns);
  EXPECT_EQ(decode("time_ns,sigma_BN_1,sigma_BN_2,sigma_BN_3,omega_BN_B_x,omega_BN_B_y"), TruthResult::no_columns);
  EXPECT_EQ(decode("0,0,0,0,0,0"), TruthResult::no_columns);
  EXPECT_EQ(decode(required.substr(8)), TruthResult::no_columns);
  EXPECT_EQ(decode(required), TruthResult::no_state);
  EXPECT_EQ(decode("0,0,0,0,0,0,0"), TruthResult::ok);
}

TEST_F(CsvTruth, ConfiguredColumnsNeedNoHeaderAndYieldToOne) {
  const std::vector<std::string> names = {"omega_BN_B_x", "omega_BN_B_y", "omega_BN_B_z", " sigma_BN_1",
                                          "sigma_BN_2",   "sigma_BN_3",   "time_ns"};
  make(csv_settings({{"columns", names}}));
  ASSERT_EQ(decode("1,2,3,0,0,0,7"), TruthResult::ok);
  EXPECT_EQ(truth_.omega_BN_B, Vector3(1, 2, 3));
  EXPECT_EQ(truth_.time.ns, 7);
  ASSERT_EQ(decode(required), TruthResult::no_state);
  ASSERT_EQ(decode("7,0,0,0,1,2,3"), TruthResult::ok);
  EXPECT_EQ(truth_.omega_BN_B, Vector3(1, 2, 3));
  EXPECT_THROW(make(csv_settings({{"columns", std::vector<std::string>(names.begin() + 1, names.end())}})),
               std::invalid_argument);
  EXPECT_THROW(make(csv_settings({{"columns", std::vector<std::string>(Columns::max_columns + 1, "time_ns")}})),
               std::invalid_argument);
}

TEST_F(CsvTruth, EveryCause) {
  ASSERT_EQ(decode(required + "\n"), TruthResult::no_state);
  for (const std::string_view remark : {"", "\n", " \r\n", "# a comment"})
    EXPECT_EQ(decode(remark), TruthResult::no_state);
  EXPECT_EQ(decode("0,0,0,0,0,0"), TruthResult::too_short);
  EXPECT_EQ(decode("0"), TruthResult::too_short);
  EXPECT_EQ(decode("0,0;0,0,0,0,0"), TruthResult::too_short);  // a number may end only where its field does
  EXPECT_EQ(decode("0,0,0,0,0,0,0,0"), TruthResult::too_long);
  EXPECT_EQ(decode("0,0,0,0,0,0,0,"), TruthResult::too_long);
  for (const std::string_view bad : {"x,0,0,0,0,0,0", ",0,0,0,0,0,0", "0,,0,0,0,0,0", "0,0,0,0,0,0,1.0.0",
                                     "0,0,0,0,0,0,0x10", "0,0 0,0,0,0,0,0", "0,0,0,0,0,1e999,0", "0,0,0,0,0,0,+-1"})
    EXPECT_EQ(decode(bad), TruthResult::bad_number) << bad;
  for (const std::string_view bad : {"nan,0,0,0,0,0,0", "0,0,inf,0,0,0,0", "0,0,0,0,0,0,-nan", "-inf,0,0,0,0,0,0"})
    EXPECT_EQ(decode(bad), TruthResult::not_finite) << bad;
  for (const std::string_view bad : {"0,0,0,0,2e5,0,0", "0,1e200,0,0,0,0,0", "1e19,0,0,0,0,0,0",
                                     "9223372036854775807,0,0,0,0,0,0", "99999999999999999999,0,0,0,0,0,0"})
    EXPECT_EQ(decode(bad), TruthResult::out_of_range) << bad;
  EXPECT_EQ(decode("\t0 , 0,0, +0.5,0,0, 1e-3 \r\n"), TruthResult::ok);
}

TEST_F(CsvTruth, TimesAreIntegersOrFloats) {
  ASSERT_EQ(decode(required), TruthResult::no_state);
  for (const auto& [text, ns] : {std::pair<std::string, std::int64_t>{"50000000", 50000000},
                                 {"5e7", 50000000},
                                 {"-1.5e3", -1500},
                                 {"1700000000123456789", 1700000000123456789},
                                 {"0.6", 1},
                                 {"+7", 7}}) {
    ASSERT_EQ(decode(text + ",0,0,0,0,0,0"), TruthResult::ok) << text;
    EXPECT_EQ(truth_.time.ns, ns) << text;
  }
}

TEST_F(CsvTruth, OfTwoColumnsWithOneNameTheFirstCounts) {
  ASSERT_EQ(decode(required + ",omega_BN_B_z,time_ns"), TruthResult::no_state);
  ASSERT_EQ(decode("1,0,0,0,0,0,2,3,4"), TruthResult::ok);
  EXPECT_EQ(truth_.time.ns, 1);
  EXPECT_EQ(truth_.omega_BN_B.z(), 2);
}

TEST_F(CsvTruth, ConfiguredColumnsThatAreMissingAreNamed) {
  const auto refusal = [&](std::vector<std::string> names) -> std::string {
    try {
      make(csv_settings({{"columns", std::move(names)}}));
    } catch (const std::invalid_argument& error) {
      return error.what();
    }
    return "";
  };
  const std::string wanted = "give at most 256 names, among them time_ns, sigma_BN_1 to _3, omega_BN_B_x to _z";
  EXPECT_EQ(refusal({"time_ns", "omega_BN_B_x", "sigma_BN_2", "sigma_BN_3", "omega_BN_B_y", "x"}),
            "columns: missing sigma_BN_1, omega_BN_B_z; " + wanted);
  EXPECT_EQ(refusal(std::vector<std::string>(257, "time_ns")), "columns: " + wanted);
}

// As spreadsheets write them.
TEST_F(CsvTruth, AByteOrderMarkAndQuotesAreIgnored) {
  const auto quoted = [](std::string_view row) {
    std::string text;
    while (row.data() != nullptr) text.append(text.empty() ? "\"" : ",\"").append(take_field(row)).append("\"");
    return text;
  };
  EXPECT_EQ(decode("\xEF\xBB\xBF" + required + "\r\n"), TruthResult::no_state);
  ASSERT_EQ(decode("7,0,0,0,1,2,3"), TruthResult::ok);
  EXPECT_EQ(truth_.time.ns, 7);
  make(csv_settings());
  EXPECT_EQ(decode("\xEF\xBB\xBF# a comment"), TruthResult::no_state);
  EXPECT_EQ(decode("\xEF\xBB\xBF" + quoted(required)), TruthResult::no_state);
  ASSERT_EQ(decode(quoted("8,0,0,0,1,2, 3 ")), TruthResult::ok);
  EXPECT_EQ(truth_.time.ns, 8);
  EXPECT_EQ(truth_.omega_BN_B, Vector3(1, 2, 3));
  EXPECT_EQ(decode(quoted("8,0,0,0,1,2,\"")), TruthResult::bad_number);
  EXPECT_EQ(decode("8,0,0,0,1,2,\""), TruthResult::bad_number);
  EXPECT_EQ(decode("8,0,0,0,1,2,\"3"), TruthResult::bad_number);
  std::vector<std::string> names;
  for (std::string_view rest = required; rest.data() != nullptr;) names.push_back(quoted(take_field(rest)));
  make(csv_settings({{"columns", names}}));
  EXPECT_EQ(decode("9,0,0,0,1,2,3"), TruthResult::ok);
}

// A remark may name quantities, or Basilisk's columns, among other words.
TEST_F(CsvTruth, ARemarkThatNamesColumnsIsNoHeaderRow) {
  ASSERT_EQ(decode(required), TruthResult::no_state);
  for (const std::string_view row : {"# marks: time_s,throttle", "#time_s,throttle", "# at,time_us,latitude_deg"}) {
    EXPECT_EQ(decode(row), TruthResult::no_state) << row;
    ASSERT_EQ(decode("7,0,0,0,1,2,3"), TruthResult::ok) << row;
    EXPECT_EQ(truth_.omega_BN_B, Vector3(1, 2, 3));
  }
  ASSERT_EQ(decode("time_s,yaw_deg,pitch_deg,roll_deg"), TruthResult::no_state);
  for (const std::string_view row : {"# marks: sigma_BN_1,time_ns", "# time_s,throttle", "# a comment on time_ns"}) {
    EXPECT_EQ(decode(row), TruthResult::no_state) << row;
    ASSERT_EQ(decode("2,0,0,0"), TruthResult::ok) << row;
    EXPECT_EQ(truth_.time.ns, 2'000'000'000);
  }
  ASSERT_EQ(decode(required), TruthResult::no_state);
  ASSERT_EQ(decode("# time_ms,yaw_deg,pitch_deg,roll_deg"), TruthResult::no_state);
  ASSERT_EQ(decode("2,0,0,0"), TruthResult::ok);
  EXPECT_EQ(truth_.time.ns, 2'000'000);
}

std::string with_delimiter(std::string text, char delimiter) {
  std::ranges::replace(text, ',', delimiter);
  return text;
}

TEST_F(CsvTruth, TheHeaderRowSetsTheDelimiter) {
  for (const char delimiter : {';', '\t', ','}) {
    EXPECT_EQ(decode("\xEF\xBB\xBF" + with_delimiter(required, delimiter) + "\r\n"), TruthResult::no_state);
    ASSERT_EQ(decode(with_delimiter("7,0,0,0,1, 2 ,\"3\"\r\n", delimiter)), TruthResult::ok) << delimiter;
    EXPECT_EQ(truth_.time.ns, 7);
    EXPECT_EQ(truth_.omega_BN_B, Vector3(1, 2, 3));
    EXPECT_EQ(decode(with_delimiter("7,0,0,0,1,2", delimiter)), TruthResult::too_short);
  }
  // Tabs delimit empty fields at both ends of a row, too.
  ASSERT_EQ(decode(with_delimiter("index," + required + ",note", '\t')), TruthResult::no_state);
  ASSERT_EQ(decode("\t8\t0\t0\t0\t1\t2\t3\t"), TruthResult::ok);
  EXPECT_EQ(truth_.time.ns, 8);
  EXPECT_EQ(decode("\t\t \t"), TruthResult::no_state);
}

TEST_F(CsvTruth, AFieldInQuotesMayContainTheDelimiter) {
  ASSERT_EQ(decode("\"a, b\"," + required + ",c"), TruthResult::no_state);
  ASSERT_EQ(decode("\"x,\"\",\" ,\"5\",0,0,0,1,2,3,\"y,z\""), TruthResult::ok);
  EXPECT_EQ(truth_.time.ns, 5);
  EXPECT_EQ(truth_.omega_BN_B, Vector3(1, 2, 3));
  EXPECT_EQ(decode("\"x,5,0,0,0,1,2,3,y,z"), TruthResult::too_long);
}

TEST_F(CsvTruth, ColumnsThatAreNotUsedAreNamed) {
  const auto remark_on = [this](const std::string& header) {
    EXPECT_EQ(decode(header), TruthResult::no_state);
    return remark(*decoder_, TruthResult::no_state);
  };
  EXPECT_EQ(remark(*decoder_, TruthResult::no_state), "");
  EXPECT_EQ(remark_on("# a comment"), "");
  EXPECT_EQ(remark_on(required), "");
  EXPECT_EQ(remark_on(required + ",r_BN_N_x,r_BN_N_y,r_BN_N_z"), "");
  EXPECT_EQ(remark_on("accel_x," + required + ",time_ns"),
            "columns that are not used: \"accel_x\", \"time_ns\" (given twice)");
  EXPECT_EQ(remark_on(with_delimiter(required + ",nonConservativeAccelpntB_b_X,nonConservativeAccelpntB_B_y,"
                                                "nonconservativeAccelpntB_B_z [m/s^2]",
                                     ';')),
            "columns that are not used: \"nonConservativeAccelpntB_b_X\" (did you mean "
            "\"nonConservativeAccelpntB_B_x\"?), \"nonConservativeAccelpntB_B_y\" (needs "
            "\"nonConservativeAccelpntB_B_x\"), \"nonconservativeAccelpntB_B_z [m/s^2]\" (did you mean "
            "\"nonConservativeAccelpntB_B_z\"?)");
  // Basilisk has r_CN_N beside r_BN_N.
  EXPECT_EQ(remark_on(required + ",r_BN_N_x,r_BN_N_y,r_BN_N_z,r_CN_N_x"), "columns that are not used: \"r_CN_N_x\"");
  std::string many = required;
  for (int i = 0; i < 30; ++i) many += ",other" + std::to_string(i);
  EXPECT_TRUE(remark_on(many).ends_with(", \"other15\" and 14 more")) << remark_on(many);
  make(csv_settings({{"accumulated_dv", std::string("none")}}));
  EXPECT_EQ(remark_on(required + ",TotalAccumDV_BN_B_x,TotalAccumDV_BN_B_y,TotalAccumDV_BN_B_z"),
            "columns that are not used: \"TotalAccumDV_BN_B_x\", \"TotalAccumDV_BN_B_y\", \"TotalAccumDV_BN_B_z\"");
  std::vector<std::string> names = {"gravity"};
  for (std::string_view rest = required; rest.data() != nullptr;) names.emplace_back(take_field(rest));
  make(csv_settings({{"columns", names}}));
  EXPECT_EQ(remark(*decoder_, TruthResult::no_state), "columns that are not used: \"gravity\"");
}

TEST_F(CsvTruth, MissingColumnsAreNamedWithTheRowThatWasRead) {
  const auto remark_on = [this](const std::string& row) {
    EXPECT_EQ(decode(row), TruthResult::no_columns);
    return remark(*decoder_, TruthResult::no_columns);
  };
  const std::string end = "; required are time_ns, sigma_BN_1 to _3, omega_BN_B_x to _z";
  EXPECT_EQ(remark_on("0,0.5,0\r\n"), "there was no header row before the row \"0,0.5,0\", " + end.substr(2));
  EXPECT_EQ(remark_on("time_ns;Sigma BN 1;sigma_BN_2;sigma_BN_3;omega_BN_B_y;omega_BN_B_z"),
            "the header row lacks \"sigma_BN_1\" (is it \"Sigma BN 1\"?), \"omega_BN_B_x\": \"time_ns;Sigma BN "
            "1;sigma_BN_2;sigma_BN_3;omega_BN_B_y;omega_BN_B_z\"" +
                end);
  EXPECT_EQ(remark_on("Time_ns" + required.substr(7)),
            "the header row lacks \"time_ns\" (is it \"Time_ns\"?): \"Time_ns" + required.substr(7) + "\"" + end);
  EXPECT_TRUE(remark_on(std::string(60'000, 'x')).ends_with("xxx...\"" + end));
}

TEST_F(CsvTruth, ARefusalNamesItsColumn) {
  ASSERT_EQ(decode(required + ",r_BN_N_x,v_BN_N_x,v_BN_N_y,v_BN_N_z"), TruthResult::no_state);
  const auto remark_on = [this](const std::string& row) { return remark(*decoder_, decode(row)); };
  EXPECT_EQ(remark_on("0,0,0,0,0,-2e5,0,x,0,0,0"),
            "the column \"omega_BN_B_y\" has \"-2e5\", and its limit is 1e+05 rad/s");
  EXPECT_EQ(remark_on("1e19,0,0,0,0,0,0,0,0,0,0"),
            "the column \"time_ns\" has \"1e19\", and its limit is 4611686018427387904 ns");
  EXPECT_EQ(remark_on("0,0,0,0,0,0,0,0,0,0,1e10"),
            "the column \"v_BN_N_z\" has \"1e10\", and its limit is 1e+09 m/s");
  EXPECT_EQ(remark_on("0,0,nan,0,0,0,0,0,0,0,0"), "the column \"sigma_BN_2\" has \"nan\"");
  EXPECT_EQ(remark_on("0,0,0,0,0,fast,0,0,0,0,0"), "the column \"omega_BN_B_y\" has \"fast\"");
  EXPECT_EQ(remark_on("0,0"), "a row has 2 fields, and there are 11 columns: \"0,0\"");
  ASSERT_EQ(decode(with_delimiter(required, ';')), TruthResult::no_state);
  EXPECT_EQ(remark_on("0;0;0;0;0,5;0;0"),
            "the column \"omega_BN_B_x\" has \"0,5\"; the decimal sign must be a point");
  EXPECT_EQ(remark_on("\x01"), "a row has 1 fields, and there are 7 columns: \"?\"");
}

TEST_F(CsvTruth, ANewHeaderReplacesTheOld) {
  ASSERT_EQ(decode(required), TruthResult::no_state);
  ASSERT_EQ(decode("omega_BN_B_x,omega_BN_B_y,omega_BN_B_z,sigma_BN_1,sigma_BN_2,sigma_BN_3,time_ns"),
            TruthResult::no_state);
  ASSERT_EQ(decode("1,2,3,0,0,0,9"), TruthResult::ok);
  EXPECT_EQ(truth_.time.ns, 9);
  EXPECT_EQ(decode("time_ns,sigma_BN_1"), TruthResult::no_columns);
  EXPECT_EQ(decode("1,2,3,0,0,0,9"), TruthResult::no_columns);
}

}  // namespace
}  // namespace imud
