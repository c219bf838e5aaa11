// The reader of almanacs in the YUMA format, and the keys of a receiver.
#include "emulator/ground/yuma_almanac.hpp"

#include <gtest/gtest.h>

#include <fstream>
#include <stdexcept>
#include <string>

#include "emulator/config/load_config.hpp"
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
  const std::string text = yuma_text();
  EXPECT_EQ(why(text, "", ""), "none");
  EXPECT_EQ(why("", "", ""), "line 0: there is no satellite; give an almanac in the YUMA format");
  EXPECT_EQ(why("hello\n", "", ""), "line 1: there is no satellite; give an almanac in the YUMA format");
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
  EXPECT_TRUE(contains(said_of(almanac, "2027-01-07T16:44:30Z"), "more than 13 weeks from earth.start"));
  EXPECT_TRUE(contains(said_of("gnss_almanac = \"none.yuma\"\n"), "none.yuma: cannot be read"));
  EXPECT_TRUE(contains(said_of("gnss_mask_deg = 10\n"), "gnss_mask_deg: needs gnss_almanac"));
  EXPECT_TRUE(contains(said_of("gnss_multipath_m = 3\n"), "gnss_multipath_m: needs gnss_almanac"));
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
