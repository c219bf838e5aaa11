// The readers of almanacs in the YUMA format and of navigation files of RINEX, and the keys of a receiver.
#include "emulator/ground/yuma_almanac.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <fstream>
#include <initializer_list>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "emulator/config/load_config.hpp"
#include "emulator/ground/rinex_navigation.hpp"
#include "tests/core/gnss/yuma_text.hpp"
#include "tests/support/text.hpp"
#include "tests/transports/scratch_folder.hpp"

namespace imud {
namespace {

TEST(YumaAlmanac, HasTheHealthySatellites) {
  const std::vector<AlmanacOrbit> orbits = yuma_almanac(yuma_text(), constellation_ns), expected = constellation();
  ASSERT_EQ(orbits.size(), expected.size());
  for (std::size_t i = 0; i < orbits.size(); ++i) {
    EXPECT_EQ(orbits[i].prn, expected[i].prn);
    EXPECT_EQ(orbits[i].reference_ns, constellation_ns);
    EXPECT_LT((satellite_E(orbits[i], constellation_ns) - satellite_E(expected[i], constellation_ns)).norm(), 1e-2);
    EXPECT_DOUBLE_EQ(orbits[i].node_rate, expected[i].node_rate);
  }
}

// A week modulo 1024 is the nearest one: half of its period earlier or later.
TEST(YumaAlmanac, AShortWeekIsTheNearest) {
  const auto week_of = [](int given, std::int64_t near_week) {
    return yuma_almanac(yuma_text(given), near_week * gps_week_ns).front().reference_ns / gps_week_ns;
  };
  EXPECT_EQ(week_of(352, 2400), 2400);
  EXPECT_EQ(week_of(352, 2911), 2400);
  EXPECT_EQ(week_of(352, 2913), 3424);
  EXPECT_EQ(week_of(352, 0), 352);
  EXPECT_EQ(week_of(2400, 1200), 2400);
}

TEST(YumaAlmanac, AFaultHasALineAndARemedy) {
  const auto why = [](std::string text, const std::string& from, const std::string& to) {
    if (!from.empty()) text.replace(text.find(from), from.size(), to);
    try {
      yuma_almanac(text, constellation_ns);
    } catch (const std::runtime_error& error) {
      return std::string(error.what());
    }
    return std::string("none");
  };
  const std::string text = yuma_text(),
                    none =
                        "there is no satellite; give an almanac in the YUMA format, or a navigation file in RINEX "
                        "2 or 3";
  EXPECT_EQ(why(text, "", ""), "none");
  EXPECT_EQ(why("", "", ""), "line 0: " + none);
  EXPECT_EQ(why("hello\n", "", ""), "line 1: " + none);
  EXPECT_EQ(why(text, "5153.55", "4.5"), "line 8: \"SQRT(A)  (m 1/2)\": give a number from 2000 to 10000");
  EXPECT_EQ(why(text, "week:                        2400\r\n\r\n", ""),
            "line 15: \"ID\" is not where the 13 lines of a satellite have it");
  EXPECT_EQ(why(text, "ID:                         02", "ID:                         01"),
            "line 29: the satellite 1 is there twice");
  EXPECT_EQ(why(text.substr(0, 300), "", ""), "line 8: the last satellite lacks lines");
  EXPECT_EQ(why(text, "8.000000000000E-03", "nan"), "line 4: \"Eccentricity\": give a number from 0 to 0.1");
  const std::string unhealthy = yuma_lines(orbit_of(1), 63, constellation_week);
  EXPECT_NE(why(unhealthy, "", "").find("no satellite is healthy; give another almanac"), std::string::npos);
}

// These are the broadcast ephemerides of 2010-07-01, test/data/rinex/brdc1820.10n of RTKLIB 71db0ff, with a shorter
// header, and with records of the satellites 1, which was not healthy, and 2.
const std::string rinex_2 = R"(     2              NAVIGATION DATA                         RINEX VERSION / TYPE
IGS BROADCAST EPHEMERIS FILE                                COMMENT
                                                            END OF HEADER
 1 10  7  1  0  0  0.0-0.136290676892D-03-0.397903932026D-11 0.000000000000D+00
    0.630000000000D+02-0.897500000000D+02 0.468055210664D-08-0.307674634178D+01
   -0.476092100143D-05 0.483528291807D-02 0.545941293240D-05 0.515480139732D+04
    0.345600000000D+06 0.558793544769D-08 0.292603518708D+01-0.931322574615D-07
    0.965451250348D+00 0.278437500000D+03 0.884778937154D+00-0.813998192006D-08
   -0.171792870148D-09 0.100000000000D+01 0.159000000000D+04 0.000000000000D+00
    0.200000000000D+01 0.630000000000D+02-0.190921127796D-07 0.630000000000D+02
    0.341670000000D+06 0.000000000000D+00 0.000000000000D+00 0.000000000000D+00
 2 10  7  1  0  0  0.0 0.269108917564D-03 0.318323145621D-11 0.000000000000D+00
    0.850000000000D+02 0.414375000000D+02 0.525557597442D-08 0.165772167412D+01
    0.232271850109D-05 0.960697804112D-02 0.617466866970D-05 0.515359739113D+04
    0.345600000000D+06-0.558793544769D-08-0.127458719764D+01 0.167638063431D-06
    0.939349150611D+00 0.249937500000D+03 0.309739903949D+01-0.838784952606D-08
   -0.232152526369D-10 0.100000000000D+01 0.159000000000D+04 0.000000000000D+00
    0.200000000000D+01 0.000000000000D+00-0.172294676304D-07 0.850000000000D+02
    0.338418000000D+06 0.400000000000D+01 0.000000000000D+00 0.000000000000D+00
 2 10  7  1  2  0  0.0 0.269131734967D-03 0.318323145621D-11 0.000000000000D+00
    0.101000000000D+03 0.347812500000D+02 0.519093035223D-08 0.270784133884D+01
    0.178255140781D-05 0.960644008592D-02 0.656396150589D-05 0.515359962273D+04
    0.352800000000D+06-0.217929482460D-06-0.127464812818D+01 0.577419996262D-07
    0.939349870367D+00 0.243968750000D+03 0.309751168711D+01-0.824820034495D-08
    0.120362150802D-09 0.100000000000D+01 0.159000000000D+04 0.000000000000D+00
    0.200000000000D+01 0.000000000000D+00-0.172294676304D-07 0.101000000000D+03
    0.345600000000D+06 0.000000000000D+00 0.000000000000D+00 0.000000000000D+00
)";

// These are records of georinex 95ef1d8, src/georinex/tests/data: two of BRDM00DLR_R_20130010000_01D_MN.rnx with a
// shorter header, the first of GLONASS, and one of demo_nav3.17n.
const std::string rinex_3 = R"(     3.02           NAVIGATION DATA     M (Mixed)           RINEX VERSION / TYPE
                                                            END OF HEADER
R01 2013 01 01 00 15 00-1.750094816089e-04 0.000000000000e+00 1.728000000000e+05
     8.450493652344e+03 1.381167411804e+00 0.000000000000e+00 0.000000000000e+00
    -1.874471679688e+04-1.543292045593e+00 1.862645149231e-09 1.000000000000e+00
     1.510979541016e+04-2.684219360352e+00-9.313225746155e-10 0.000000000000e+00
G02 2013 01 01 02 00 00 4.132920876145e-04 1.364242052659e-12 0.000000000000e+00
     3.200000000000e+01 3.281250000000e+01 4.757698177226e-09-2.745614259615e+00
     1.627951860428e-06 1.180972403381e-02 1.031160354614e-05 5.153588487625e+03
     1.800000000000e+05-7.450580596924e-08 1.148030760249e+00-1.192092895508e-07
     9.383943464054e-01 1.676875000000e+02-2.699199006919e+00-7.961403052965e-09
     6.093110945385e-10 0.000000000000e+00 1.721000000000e+03 0.000000000000e+00
     0.000000000000e+00 0.000000000000e+00-1.769512891769e-08 3.200000000000e+01
     1.728000000000e+05
G01 2017 11 17 00 00 00-1.082336530089D-05-2.387423592154D-12 0.000000000000D+00
     2.600000000000D+01 4.312500000000D+01 4.455542601534D-09 2.261013945883D+00
     2.192333340645D-06 7.114754174836D-03 7.407739758492D-06 5.153672552109D+03
     4.320000000000D+05-9.126961231232D-08 7.577775093435D-01-7.450580596924D-08
     9.691207199508D-01 2.407187500000D+02 6.318014759246D-01-7.981403982171D-09
     5.718095441587D-10 1.000000000000D+00 1.975000000000D+03 0.000000000000D+00
     2.000000000000D+00 0.000000000000D+00 5.587935447693D-09 2.600000000000D+01
     4.247400000000D+05
)";

// By NumPy, which rotates the perifocal vector by matrices and solves Kepler's equation by Newton's method; eph2pos()
// of RTKLIB 71db0ff gives the same to 0.1 mm.
TEST(RinexNavigation, PositionsAreThoseOfOtherImplementations) {
  struct Known {
    double after_s;
    Vector3 r_E;
  };
  const auto expect = [](const AlmanacOrbit& orbit, std::initializer_list<Known> all, double within) {
    for (const Known& known : all)
      EXPECT_LT((satellite_E(orbit, orbit.reference_ns + static_cast<std::int64_t>(1e9 * known.after_s)) - known.r_E)
                    .norm(),
                within)
          << orbit.prn << ' ' << known.after_s;
  };
  ASSERT_TRUE(is_rinex(rinex_2) && is_rinex(rinex_3));
  const std::vector<AlmanacOrbit> two = rinex_navigation(rinex_2), three = rinex_navigation(rinex_3);
  ASSERT_EQ(two.size(), 2U);  // both of the satellite 2
  ASSERT_EQ(three.size(), 2U);
  EXPECT_EQ(two[0].prn, 2);
  EXPECT_EQ(two[0].reference_ns, 1590 * gps_week_ns + 345'600'000'000'000);
  EXPECT_EQ(two[1].reference_ns, 1590 * gps_week_ns + 352'800'000'000'000);
  EXPECT_EQ(three[0].reference_ns, 1975 * gps_week_ns + 432'000'000'000'000);
  EXPECT_EQ(three[1].reference_ns, 1721 * gps_week_ns + 180'000'000'000'000);
  constexpr double rounding = 1e-3;
  expect(two[0],
         {{0, {-14889160.5615, -5131952.9655, -21416801.5943}},
          {3600, {-13666506.8459, -14242200.4258, -17991254.0044}},
          {-7200, {-21289271.2414, 10372904.8250, -11556186.6902}}},
         rounding);
  expect(two[1], {{0, {-13852364.2154, -20737426.0457, -9790994.2500}}}, rounding);
  expect(
      three[0],
      {{0, {-22511073.6954, -13352858.1883, 5182957.2049}}, {3600, {-21895186.0691, -14074445.9688, -6117616.6582}}},
      rounding);
  expect(three[1],
         {{0, {8582452.4809, 19801795.9188, 15972536.5574}}, {3600, {741281.6285, 16518068.5251, 21029546.2811}}},
         rounding);
  // The final orbits of the International GNSS Service for that day, test/data/sp3/igs15904.sp3 there: ephemerides
  // are good to 2 m.
  constexpr double broadcast = 2;
  expect(two[0],
         {{0, {-14889160.729, -5131952.946, -21416801.336}}, {3600, {-13666506.657, -14242199.755, -17991254.551}}},
         broadcast);
  expect(two[1], {{0, {-13852363.356, -20737426.203, -9790994.987}}}, broadcast);
}

std::string changed(std::string text, const std::string& from, const std::string& to) {
  return text.replace(text.find(from), from.size(), to);
}

std::string why_not_rinex(const std::string& text) {
  try {
    rinex_navigation(text);
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return "none";
}

TEST(RinexNavigation, WritersDifferInExponentsLineEndsAndWeeks) {
  for (const char* week : {"0.566000000000E+03", "0.159100000000d+04", "1590.0            "}) {
    std::string text = changed(rinex_2, "0.159000000000D+04", week);
    for (std::size_t at = 0; (at = text.find('\n', at)) != text.npos; at += 2) text.insert(at, "\r");
    EXPECT_EQ(rinex_navigation(text + "\r\n").size(), 2U) << week;
  }
  // Without the columns that nobody reads.
  EXPECT_EQ(rinex_navigation(rinex_2.substr(0, rinex_2.rfind("    0.345600000000D+06") + 4)).size(), 2U);
  // A satellite whose second ephemeris is not healthy keeps the first.
  const std::vector<AlmanacOrbit> orbits = rinex_navigation(
      changed(rinex_2, "0.000000000000D+00-0.172294676304D-07 0.101", "0.100000000000D+01-0.172294676304D-07 0.101"));
  ASSERT_EQ(orbits.size(), 2U);
  EXPECT_TRUE(orbits[0].is_healthy && !orbits[1].is_healthy);
}

TEST(RinexNavigation, AFaultHasALineAndARemedy) {
  EXPECT_EQ(why_not_rinex(rinex_2), "none");
  EXPECT_EQ(why_not_rinex(changed(rinex_2, "     2 ", "     4 ")),
            "line 1: the version \"4\" is not read; give a file of RINEX 2 or 3");
  EXPECT_EQ(why_not_rinex(changed(rinex_2, "     2 ", "  2\x1B[2J")),  // a terminal would obey it
            "line 1: the version \"2\\x1b[2J\" is not read; give a file of RINEX 2 or 3");
  EXPECT_EQ(why_not_rinex(changed(rinex_2, "NAVIGATION DATA ", "OBSERVATION DATA")),
            "line 1: a file of the type \"O\" has no ephemerides of GPS; give a navigation file, of the type \"N\"");
  EXPECT_EQ(why_not_rinex(changed(rinex_2, "END OF HEADER", "end of header")),
            "line 27: the header has no end; give a line \"END OF HEADER\" in column 61");
  EXPECT_EQ(why_not_rinex(changed(rinex_2, "\n 2 10", "\n77 10")),
            "line 12: give the number of a satellite, from 1 to 63, in columns 1 and 2");
  EXPECT_EQ(why_not_rinex(changed(rinex_2, " 2 10  7  1", " 2 10  6 31")),
            "line 12: give year, month, day, hour, minute and second, from 1981 to 2099, in columns 4 to 22");
  EXPECT_EQ(why_not_rinex(changed(rinex_2, "0.515480139732D+04", "0.515480139732D+02")),
            "line 6: sqrt(A), columns 61 to 79: give a number from 2000 to 10000");
  EXPECT_EQ(why_not_rinex(changed(rinex_2, "0.159000000000D+04", "0.158000000000D+04")),
            "line 11: the record of satellite 1 has the week 1580; give 1590, the one of its epoch");
  EXPECT_NE(why_not_rinex(changed(rinex_2, "0.159000000000D+04", "0.159200000000D+04")), "none");
  EXPECT_EQ(why_not_rinex(changed(rinex_2, "    0.341670000000D+06", " 2  0.341670000000D+06")),
            "line 10: the record of satellite 1 ends here; give 7 lines after its first, which begin with 3 blanks");
  EXPECT_EQ(why_not_rinex(changed(rinex_3, "G02", "#02")),
            "line 7: give a record, whose first column is the letter of its system, G for GPS");
  EXPECT_EQ(why_not_rinex(rinex_3.substr(0, rinex_3.find("G02"))),
            "line 6: there is no satellite of GPS; give a file with records of GPS");
  EXPECT_EQ(why_not_rinex(rinex_2.substr(0, rinex_2.find("\n 2 10") + 1)),
            "line 11: no satellite is healthy; give another file");
}

// Any byte, and any end, is an error with a line or gives orbits that can be used.
TEST(RinexNavigation, AnyByteMayBeWrong) {
  int refused = 0, read = 0;
  const auto expect_sound = [&](const std::string& text) {
    if (!is_rinex(text)) return;
    try {
      for (const AlmanacOrbit& orbit : rinex_navigation(text)) {
        const double distance = satellite_E(orbit, orbit.reference_ns + gps_week_ns).norm();
        ASSERT_TRUE(distance > 3.5e6 && distance < 1.2e8) << distance;
        ASSERT_TRUE(orbit.prn >= 1 && orbit.prn <= 63);
      }
      ++read;
    } catch (const std::runtime_error& error) {
      ASSERT_EQ(std::string_view(error.what()).substr(0, 5), "line ");
      ++refused;
    }
  };
  for (const std::string* text : {&rinex_2, &rinex_3})
    for (std::size_t at = 0; at < text->size(); ++at) {
      for (const char byte : {'\0', '\n', ' ', '9', '-', 'D', 'G', '\xff'}) {
        std::string wrong = *text;
        wrong[at] = byte;
        expect_sound(wrong);
      }
      expect_sound(text->substr(0, at));
    }
  EXPECT_GT(refused, 1000);
  EXPECT_GT(read, 1000);
}

class ReceiverKeysTest : public testing::Test {
 protected:
  // Returns the warnings, or the faults, of a configuration with these keys of the navigation.
  std::string said_of(const std::string& keys, const std::string& start = "2026-01-07T16:44:30Z") const {
    const std::string file = folder_ / "imud.toml";
    std::ofstream(file) << "[truth]\nport = \"udp:127.0.0.1:9810\"\n[earth]\nframe = \"local\"\nlatitude_deg = "
                           "45\nlongitude_deg = 0\n"
                           "start = "
                        << start
                        << "\n[[imu]]\nprotocol = \"native\"\nport = \"pty:imu1\"\nrate_hz = 50\n"
                           "gyro.max_rad_per_s = 10\naccelerometer.max_m_per_s2 = 200\n[imu.navigation]\n"
                        << keys;
    std::string all;
    try {
      for (const std::string& warning : load_config(file).warnings) all += warning + '\n';
    } catch (const ConfigError& error) {
      all = error.what();
    }
    return all;
  }
  ScratchFolder folder_;
};

TEST_F(ReceiverKeysTest, AreChecked) {
  std::ofstream(folder_ / "mine.yuma") << yuma_text();
  const std::string almanac = "gnss_almanac = \"mine.yuma\"\n";
  EXPECT_EQ(said_of(almanac + "gnss_mask_deg = 10\ngnss_multipath_m = 3\n"), "");
  EXPECT_NE(said_of("gnss_almanac = \"\"\ngnss_mask_deg = 5\n").find("needs gnss_almanac"), std::string::npos);
  std::filesystem::create_directory(folder_ / "folder");
  EXPECT_NE(said_of("gnss_almanac = \"folder\"\n").find("Is a directory"), std::string::npos);
  EXPECT_TRUE(contains(said_of("gnss_almanac = \"/dev/zero\"\n"), "/dev/zero: cannot be read: File too large"));
  EXPECT_TRUE(contains(said_of(almanac, "2027-01-07T16:44:30Z"), "more than 13 weeks from earth.start"));
  EXPECT_TRUE(contains(said_of("gnss_almanac = \"none.yuma\"\n"), "none.yuma: cannot be read"));
  EXPECT_TRUE(contains(said_of("gnss_mask_deg = 10\n"), "gnss_mask_deg: needs gnss_almanac"));
  EXPECT_TRUE(contains(said_of("gnss_multipath_m = 3\n"), "gnss_multipath_m: needs gnss_almanac"));
  const std::string rinex = "gnss_almanac = \"mine.rnx\"\n", of_2017 = "2017-11-17T00:30:00Z";
  std::ofstream(folder_ / "mine.rnx") << rinex_3;
  EXPECT_TRUE(contains(said_of(rinex, of_2017), "its satellite 2 is of a date more than 13 weeks from earth.start"));
  const std::size_t of_2013 = rinex_3.find("G02");
  std::ofstream(folder_ / "mine.rnx") << std::string(rinex_3).erase(of_2013, rinex_3.find("G01") - of_2013);
  EXPECT_EQ(said_of(rinex, of_2017), "");
  EXPECT_TRUE(contains(said_of(rinex), "its satellite 1 is of a date more than 13 weeks"));
  std::ofstream(folder_ / "mine.rnx") << changed(rinex_2, "D+04", "?+04");
  EXPECT_TRUE(contains(said_of(rinex), "mine.rnx: line 6: sqrt(A), columns 61 to 79: give a number from 2000"));
  std::ofstream(folder_ / "mine.yuma") << yuma_text().substr(0, 300);
  EXPECT_TRUE(contains(said_of(almanac), "mine.yuma: line 8: the last satellite lacks lines"));
}

// Keys of the barometer's heights act on nothing where none is used.
TEST_F(ReceiverKeysTest, HeightsNeedARate) {
  const std::string filter = "solution = \"filter\"\n";
  for (const char* key : {"barometric_height_m", "barometric_walk_m_per_rt_s"}) {
    const std::string keys = filter + key + " = 1\n";
    EXPECT_TRUE(contains(said_of(keys), std::string(key) + ": has no effect without a barometer_rate_hz above 0"));
    EXPECT_FALSE(contains(said_of(keys + "barometer_rate_hz = 10\n"), key));
  }
  EXPECT_FALSE(contains(said_of(filter), "barometric"));
}

}  // namespace
}  // namespace imud
