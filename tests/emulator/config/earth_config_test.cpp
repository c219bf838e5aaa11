// Truth that has places on the Earth, with and without [earth]: what check refuses, what a run reports and warns of.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <string>
#include <tuple>
#include <vector>

#include "emulator/config/load_config.hpp"
#include "emulator/plan/config.hpp"
#include "tests/emulator/run/run_test.hpp"
#include "tests/support/text.hpp"

namespace imud {
namespace {

class EarthConfigTest : public RunTest {
 protected:
  struct Place {
    double latitude_deg = 0, longitude_deg = 0;
  };

  // Writes a configuration whose imu reports its place to a CAN log.
  std::string config_of(const std::string& truth, const std::string& earth, const std::string& format = "csv") const {
    return write("place.toml",
                 "clock = \"fast\"\n[truth]\nport = \"file:" + truth + "\"\nformat = \"" + format + "\"\n" + earth +
                     "[[imu]]\nprotocol = \"sbg-can\"\nmodel = \"ideal\"\nport = \"canfile:" + path("place.log") +
                     "\"\ndevice.messages = [\"ekf_pos\"]\n");
  }
  ProgramResult run(const std::string& truth, const std::string& earth, const std::string& format = "csv") {
    const std::string config = config_of(truth, earth, format);
    return run_program("imud", {"run", config, "--summary", path("summary.json")});
  }
  // Returns the places in the log: SBG's frame 0x134 has latitude and longitude in 1e-7 deg, little-endian.
  std::vector<Place> places() const {
    std::vector<Place> all;
    for (const std::string& line : lines_of(read_file(path("place.log")))) {
      const std::size_t at = line.find("134#");
      if (at == line.npos || line.size() < at + 20) continue;
      const auto number = [&](std::size_t digit) {
        std::uint32_t value = 0;
        for (int i = 3; i >= 0; --i)
          value = value << 8 | static_cast<std::uint32_t>(std::stoul(
                                   line.substr(at + 4 + digit + 2 * static_cast<std::size_t>(i), 2), nullptr, 16));
        return 1e-7 * static_cast<double>(static_cast<std::int32_t>(value));
      };
      all.push_back({number(0), number(8)});
    }
    return all;
  }
  void expect_places(double latitude_deg, double longitude_deg) {
    const std::vector<Place> all = places();
    ASSERT_GT(all.size(), 3U);
    for (const Place& place : all) {
      EXPECT_NEAR(place.latitude_deg, latitude_deg, 2e-7);
      EXPECT_NEAR(place.longitude_deg, longitude_deg, 2e-7);
    }
  }
  // Rows of a vehicle that stands at 47.5 N 8.5 E; `head` and `fields` precede the others.
  std::string standing(const std::string& head = "time_s",
                       const std::vector<std::string>& fields = {"0", "0.1", "0.2"}) const {
    std::string text = head +
                       ",q_LB_w,q_LB_x,q_LB_y,q_LB_z,p_BE_deg_per_s,q_BE_deg_per_s,r_BE_deg_per_s,"
                       "specific_force_x_m_per_s2,specific_force_y_m_per_s2,specific_force_z_m_per_s2,latitude_deg,"
                       "longitude_deg,height_m,v_north_m_per_s,v_east_m_per_s,v_down_m_per_s\n";
    for (const std::string& field : fields) text += field + ",1,0,0,0,0,0,0,0,0,-9.81,47.5,8.5,500,0,0,0\n";
    return write("standing.csv", text);
  }
};

TEST_F(EarthConfigTest, TruthOnTheEarthIsWhereItIs) {
  const std::string truth = standing();
  for (const char* earth :
       {"", "[earth]\nstart = 2026-11-22T12:00:00Z\n", "[earth]\nframe = \"auto\"\n",
        "[earth]\nframe = \"inertial\"\nstart = 2026-11-22T12:00:00Z\n",
        "[earth]\nframe = \"inertial\"\nangle_deg = 0\n", "[earth]\nframe = \"inertial\"\nangle_deg = \"auto\"\n"}) {
    const ProgramResult result = run(truth, earth);
    ASSERT_EQ(result.exit_code, 0) << earth << result.errors;
    expect_places(47.5, 8.5);
    EXPECT_FALSE(contains(result.errors, "latitude")) << result.errors;
    EXPECT_FALSE(contains(result.errors, "angle")) << result.errors;
  }
  ASSERT_EQ(run(truth, "[earth]\nframe = \"none\"\n").exit_code, 0);
  expect_places(0, 0);
  // The angle of each truth, where it has one: 30 deg at time 0.
  const std::string angled =
      standing("time_s,earth_angle_deg", {"0,30", "0.1,30.000417807462", "0.2,30.000835614924"});
  ASSERT_EQ(run(angled, "").exit_code, 0);
  expect_places(47.5, 8.5);
}

// The Earth's models take time: an imu whose bytes never depend on the place does without.
TEST_F(EarthConfigTest, AnImuThatSendsNoPlaceDoesNotComputeIt) {
  for (const auto& [protocol, port, frame] : {std::tuple{"native", "file:a", EarthModel::Frame::none},
                                              {"csv", "file:a", EarthModel::Frame::none},
                                              {"native-can", "canfile:a", EarthModel::Frame::none},
                                              {"hg4930", "file:a", EarthModel::Frame::none},
                                              {"dmu", "file:a", EarthModel::Frame::none},
                                              {"bno08x-rvc", "file:a", EarthModel::Frame::automatic},
                                              {"nmea-attitude", "file:a", EarthModel::Frame::automatic},
                                              {"sensaition-ins", "file:a", EarthModel::Frame::automatic},
                                              {"sbg-can", "canfile:a", EarthModel::Frame::automatic},
                                              {"vectornav", "file:a", EarthModel::Frame::automatic}}) {
    const bool is_product = find_protocol(protocol) != nullptr && frame == EarthModel::Frame::automatic;
    const Config config = load_config(write(
        "place.toml",
        fmt::format("[truth]\nport = \"udp:127.0.0.1:5140\"\nformat = \"jsbsim\"\n[[imu]]\nprotocol = \"{}\"\n"
                    "port = \"{}\"\n{}",
                    protocol, port,
                    is_product ? "" : "rate_hz = 600\ngyro.max_rad_per_s = 1\naccelerometer.max_m_per_s2 = 99\n")));
    EXPECT_EQ(config.imus[0].model.earth.frame, frame) << protocol;
  }
  // A described unit whose only quantity of a place is the heading of its antennas.
  for (const auto& [quantity, frame] : {std::tuple{"gnss_heading_deg", EarthModel::Frame::automatic},
                                        {"gnss_has_heading", EarthModel::Frame::automatic},
                                        {"rate_x_deg_per_s", EarthModel::Frame::none}}) {
    const std::string frames = write(
        "compass.toml",
        fmt::format("frame_version = 1\nname = \"compass\"\nrate_hz = 10\nbyte_order = \"little\"\n[[message]]\n"
                    "name = \"data\"\nlayout = [\"55 AA\", \"@begin\", \"alive_counter:u8\", \"{}:i16*0.01\", "
                    "\"check:crc16/ibm-3740:@begin.. be\"]\n",
                    quantity));
    const Config config =
        load_config(write("place.toml",
                          "[truth]\nport = \"udp:127.0.0.1:5140\"\nformat = \"jsbsim\"\n[[imu]]\nprotocol = "
                          "\"frame\"\nport = \"file:a\"\nrate_hz = 10\ngyro.max_rad_per_s = 1\n"
                          "accelerometer.max_m_per_s2 = 99\ndevice.frame_file = \"" +
                              frames + "\"\n"));
    EXPECT_EQ(config.imus[0].model.earth.frame, frame) << quantity;
  }
}

// A described product that has an attitude, but no place: yaw, pitch and roll follow the length and the number.
TEST_F(EarthConfigTest, AnAttitudeIsRelativeToTheLocalLevelOfThePlace) {
  const std::string config =
      write("attitude.toml", "clock = \"fast\"\n[truth]\nport = \"file:" + standing() +
                                 "\"\nformat = \"csv\"\n[[imu]]\nprotocol = \"bno08x-rvc\"\nrate_hz = 100\n"
                                 "gyro.max_rad_per_s = 1\naccelerometer.max_m_per_s2 = 99\nport = \"file:" +
                                 path("attitude.bin") + "\"\n");
  ASSERT_EQ(run_program("imud", {"run", config}).exit_code, 0);
  constexpr std::size_t size = 19;
  const std::string sent = read_file(path("attitude.bin"));
  ASSERT_GT(sent.size(), 10 * size);
  for (std::size_t at = 0; at + size <= sent.size(); at += size)
    ASSERT_EQ(sent.substr(at + 3, 6), std::string(6, '\0')) << at / size;
}

TEST_F(EarthConfigTest, AContradictionThatTheRowsShowIsWarnedOf) {
  const std::string truth = standing();
  const ProgramResult local = run(truth, "[earth]\nframe = \"local\"\nlatitude_deg = -33\nlongitude_deg = 151\n");
  ASSERT_EQ(local.exit_code, 0) << local.errors;
  expect_places(47.5, 8.5);
  EXPECT_TRUE(contains(local.errors, "it is at latitude 47.500000, longitude 8.500000 deg by its own place"))
      << local.errors;
  EXPECT_TRUE(contains(local.errors, "the origin of N at -33.000000, 151.000000")) << local.errors;
  const ProgramResult angle = run(truth, "[earth]\nframe = \"inertial\"\nangle_deg = 118.5\n");
  ASSERT_EQ(angle.exit_code, 0) << angle.errors;
  expect_places(47.5, 8.5);
  EXPECT_TRUE(contains(angle.errors, "is 0.000000 deg by the truth, which is used, and earth.angle_deg = 118.500000"))
      << angle.errors;
  EXPECT_EQ(summary()["truth"]["remarks"].size(), 1U);
  const std::string dated = standing("unix_time_s", {"1800000000", "1800000000.1", "1800000000.2"});
  const ProgramResult date = run(dated, "");
  expect_places(47.5, 8.5);
  EXPECT_TRUE(contains(date.errors,
                       "its time 0 is 2027-01-15T08:00:00Z by its own date, and earth.start is "
                       "2025-01-01T00:00:00Z"))
      << date.errors;
  EXPECT_FALSE(contains(run(dated, "[earth]\nstart = 2027-01-15T08:00:00Z\n").errors, "by its own date"));
  const std::string later = standing("unix_time_s", {"1800003723", "1800003723.1", "1800003723.2"});
  const ProgramResult both = run(later, "[earth]\nstart = 2026-12-31T23:58:59Z\n");
  EXPECT_TRUE(
      contains(both.errors, "is 2027-01-15T09:02:03Z by its own date, and earth.start is 2026-12-31T23:58:59Z"))
      << both.errors;

  // In a local frame a date is not counted from the first row: no earth.start is as early as its time 0.
  std::string level =
      "unix_time_s,q_NB_w,q_NB_x,q_NB_y,q_NB_z,p_deg_per_s,q_deg_per_s,r_deg_per_s,specific_force_x_m_per_s2,"
      "specific_force_y_m_per_s2,specific_force_z_m_per_s2,r_BN_N_x_m,r_BN_N_y_m,r_BN_N_z_m,v_BN_N_x_m_per_s,"
      "v_BN_N_y_m_per_s,v_BN_N_z_m_per_s\n";
  for (const char* time : {"1800000000", "1800000000.1", "1800000000.2"})
    level += std::string(time) + ",1,0,0,0,0,0,0,0,0,-9.81,0,0,0,0,0,0\n";
  const ProgramResult undated =
      run(write("level.csv", level), "[earth]\nframe = \"local\"\nlatitude_deg = 47.5\nlongitude_deg = 8.5\n");
  EXPECT_TRUE(contains(undated.errors, "its time 0 is 1970-01-01T00:00:00Z by its own date")) << undated.errors;
  EXPECT_TRUE(contains(undated.errors, "give times since the first truth, such as time_s")) << undated.errors;

  // Positions relative to some N.
  const auto positions = [&](const std::string& x) {
    std::string text =
        "time_ns,sigma_BN_1,sigma_BN_2,sigma_BN_3,omega_BN_B_x,omega_BN_B_y,omega_BN_B_z,r_BN_N_x,"
        "r_BN_N_y,r_BN_N_z,v_BN_N_x,v_BN_N_y,v_BN_N_z\n";
    for (const char* time : {"0", "100000000", "200000000"})
      text += std::string(time) + ",0,0,0,0,0,0," + x + ",0,0,0,0,0\n";
    return write("positions.csv", text);
  };
  const ProgramResult shallow = run(positions("12"), "[earth]\nframe = \"inertial\"\n");
  EXPECT_TRUE(contains(shallow.errors, "12 m from N's origin, which earth.frame = \"inertial\"")) << shallow.errors;
  const ProgramResult far =
      run(positions("7000000"), "[earth]\nframe = \"local\"\nlatitude_deg = 1\nlongitude_deg = 2\n");
  EXPECT_TRUE(
      contains(far.errors, "7000000 m from N's origin, which earth.frame = \"local\" has at latitude 1.000000"))
      << far.errors;
  EXPECT_FALSE(contains(run(positions("7000000"), "[earth]\nframe = \"inertial\"\n").errors, "from N's origin"));
}

TEST_F(EarthConfigTest, AContradictionOfTheConfigurationIsRefused) {
  const std::string local = "[earth]\nframe = \"local\"\nlatitude_deg = 47.5\nlongitude_deg = 8.5\n";
  const std::string inertial = "[earth]\nframe = \"inertial\"\n";
  const auto check = [&](const std::string& format, const std::string& keys) {
    const std::string imu =
        "[[imu]]\nprotocol = \"native\"\nport = \"udp:127.0.0.1:9900\"\nrate_hz = 100\n"
        "gyro.max_rad_per_s = 10\naccelerometer.max_m_per_s2 = 100\n";
    const std::string config =
        write("check.toml", "[truth]\nport = \"udp:127.0.0.1:9810\"\nformat = \"" + format + "\"\n" + keys + imu);
    return run_program("imud", {"check", config});
  };
  for (const char* format : {"mavlink", "fgnetfdm", "xplane", "dis", "jsbsim"}) {
    const ProgramResult refused = check(format, local);
    EXPECT_EQ(refused.exit_code, 2) << format;
    EXPECT_TRUE(contains(refused.errors, "earth.frame: N of " + std::string(format) + " truth is inertial"))
        << refused.errors;
    const ProgramResult good = check(format, "");
    EXPECT_EQ(good.exit_code, 0) << good.errors;
    EXPECT_TRUE(contains(good.output, "earth    the truth has places on the Earth")) << good.output;
    EXPECT_EQ(check(format, inertial).exit_code, 0);
  }
  EXPECT_EQ(check("mavlink", inertial + "angle_deg = 0\n").exit_code, 0);
  EXPECT_EQ(check("mavlink", inertial + "angle_deg = 360\n").exit_code, 0);
  const ProgramResult turned = check("mavlink", inertial + "angle_deg = 30\n");
  EXPECT_EQ(turned.exit_code, 2);
  EXPECT_TRUE(contains(turned.errors, "earth.angle_deg: is 30, but N of this truth")) << turned.errors;
  EXPECT_EQ(check("jsbsim", inertial + "angle_deg = 30\n").exit_code, 0) << "each row has its own";
  EXPECT_EQ(check("mavlink", inertial + "angle_deg = \"north\"\n").exit_code, 2);
  EXPECT_EQ(check("42", local).exit_code, 2);
  EXPECT_EQ(check("42", inertial).exit_code, 0);
  const std::string json = "json\"\ncolumns = {time_s = \"t\", yaw_deg = \"y\", pitch_deg = \"p\", roll_deg = \"r\"";
  const ProgramResult level = check(json + "}\nlevel = \"ned", inertial);
  EXPECT_EQ(level.exit_code, 2);
  EXPECT_TRUE(contains(level.errors, "N of json truth is a local level")) << level.errors;
  EXPECT_EQ(check(json + "}\nlevel = \"ned", local).exit_code, 0);
  EXPECT_EQ(check("native", local).exit_code, 0);
  EXPECT_EQ(check("native", inertial).exit_code, 0);
  // The place of the vehicle at rest.
  EXPECT_EQ(check("mavlink", "[earth]\nrest_latitude_deg = 47\nrest_longitude_deg = 8\n").exit_code, 0);
  EXPECT_EQ(check("mavlink", "[earth]\nrest_height_m = 47\n").exit_code, 2) << "without a latitude";
}

}  // namespace
}  // namespace imud
