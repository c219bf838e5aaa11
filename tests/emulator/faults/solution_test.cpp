// The solution of a unit's own filter in the messages of products, with faults of its sensors and of its receiver.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

#include "tests/emulator/faults/faulty_run.hpp"
#include "tests/support/text.hpp"

namespace imud {
namespace {

// $VNINS of a VN-200 (vnproglib, register 63).
struct Vnins {
  double time_of_week = 0;
  unsigned status = 0;
  double yaw = 0, pitch = 0, roll = 0, latitude = 0, longitude = 0, height = 0, v_n = 0, v_e = 0, v_d = 0;
  double attitude_error = 0, position_error = 0, velocity_error = 0;
};

class SolutionTest : public FaultyRunTest {
 protected:
  std::vector<Vnins> fly(const std::string& solution, const std::string& faults = "") {
    const Result result = run("[earth]\nframe = \"inertial\"\n" + faults, "vectornav", 1,
                              "model = \"vn-100\"\n[imu.device]\nmodel = \"vn-200\"\nasync_type = 22\nasync_hz = 40\n"
                              "[imu.navigation]\nposition_noise_m = 1\nvelocity_noise_m_per_s = 0.05\n" +
                                  solution);
    std::vector<Vnins> all;
    for (const Sent& sent : result.frames) {
      Vnins m;
      unsigned week = 0;
      if (std::sscanf(sent.bytes.c_str(), "$VNINS,%lf,%u,%x,%lf,%lf,%lf,%lf,%lf,%lf,%lf,%lf,%lf,%lf,%lf,%lf",
                      &m.time_of_week, &week, &m.status, &m.yaw, &m.pitch, &m.roll, &m.latitude, &m.longitude,
                      &m.height, &m.v_n, &m.v_e, &m.v_d, &m.attitude_error, &m.position_error,
                      &m.velocity_error) == 15)
        all.push_back(m);
    }
    EXPECT_GE(all.size(), 380U);
    return all;
  }
  static std::string filter() { return "solution = \"filter\"\n"; }
  static std::string truth_alone() { return "solution = \"truth\"\n"; }
  static std::string gnss_fault(const char* kind, const char* settings) {
    return fmt::format("[[fault]]\ntarget = \"gnss\"\nkind = \"{}\"\n{}at_s = 4\nfor_s = 3\n", kind, settings);
  }
  // Degrees between two directions about the same axis.
  static double apart(double a, double b) { return std::abs(std::remainder(a - b, 360.0)); }
  static double metres_apart(const Vnins& a, const Vnins& b) {
    const double north = 111'000 * (a.latitude - b.latitude),
                 east = 111'000 * std::cos(a.latitude * 0.0175) * (a.longitude - b.longitude);
    return std::hypot(std::hypot(north, east), a.height - b.height);
  }
};

TEST_F(SolutionTest, AlignsThenTracks) {
  const std::vector<Vnins> truth = fly(truth_alone()), solution = fly(filter());
  ASSERT_EQ(truth.size(), solution.size());
  std::size_t aligning = 0, tracking = 0;
  for (std::size_t i = 0; i < truth.size(); ++i) {
    EXPECT_EQ(truth[i].status, 0x0006U);
    if (solution[i].attitude_error > 179) {
      ++aligning;
      EXPECT_EQ(solution[i].status, 0x0005U) << i;  // aligning, with a fix
      EXPECT_LT(metres_apart(solution[i], truth[i]), 15) << "the receiver's, of up to 0.2 s ago at 53 m/s";
      EXPECT_GT(solution[i].position_error, 0.1);
      continue;
    }
    ++tracking;
    ASSERT_EQ(solution[i].status, solution[i].attitude_error > 2 ? 0x0005U : 0x0006U) << i;
    EXPECT_LT(apart(solution[i].pitch, truth[i].pitch), 2) << i;
    EXPECT_LT(apart(solution[i].roll, truth[i].roll), 2) << i;
    EXPECT_LT(apart(solution[i].yaw, truth[i].yaw), 8) << i;
    EXPECT_LT(metres_apart(solution[i], truth[i]), 8) << i;
    EXPECT_GT(solution[i].position_error, 0.1);
    EXPECT_LT(solution[i].position_error, 5);
  }
  EXPECT_NEAR(static_cast<double>(aligning), 40, 4);  // a second
  EXPECT_GT(tracking, 330U);
}

TEST_F(SolutionTest, GoesOnWithoutAFix) {
  const std::vector<Vnins> whole = fly(filter()), lost = fly(filter(), gnss_fault("no_fix", ""));
  ASSERT_EQ(whole.size(), lost.size());
  std::size_t outage = 0;
  double last_time = 0, largest_error = 0;
  for (std::size_t i = 60; i < lost.size(); ++i) {
    EXPECT_GT(lost[i].time_of_week, last_time) << i;
    last_time = lost[i].time_of_week;
    EXPECT_NE(lost[i].latitude, 0) << i;
    EXPECT_LT(metres_apart(whole[i], lost[i]), 30) << i;
    if (lost[i].status == 0x0006) continue;
    ++outage;
    ASSERT_EQ(lost[i].status, 0x0002U) << i;  // tracking, no fix
    largest_error = std::max(largest_error, lost[i].position_error);
  }
  EXPECT_NEAR(static_cast<double>(outage), 120, 2);
  EXPECT_GE(largest_error, 0.3);  // m; it grows by the noise of three seconds
  EXPECT_LE(whole[270].position_error, 0.3);
}

TEST_F(SolutionTest, AGyroFaultTurnsTheAttitude) {
  const std::string bias =
      "[[fault]]\ntarget = \"gyro.x\"\nkind = \"bias\"\nvalue_deg_per_s = 8\nat_s = 4\nfor_s = 3\n";
  const std::vector<Vnins> truth = fly(truth_alone(), bias), solution = fly(filter(), bias);
  ASSERT_EQ(truth.size(), solution.size());
  double before = 0, largest = 0;
  for (std::size_t i = 60; i < truth.size(); ++i) {
    double& most = i < 160 ? before : largest;
    most = std::max(most, apart(solution[i].roll, truth[i].roll));
  }
  EXPECT_LT(before, 3);
  EXPECT_GT(largest, 5);
}

TEST_F(SolutionTest, KeysAreChecked) {
  const auto load = [&](const std::string& keys) {
    return load_config(write("solution.toml", config_text("[earth]\nframe = \"inertial\"\n", "vectornav", 1,
                                                          "[imu.navigation]\n" + keys)));
  };
  EXPECT_TRUE(load("solution = \"filter\"\ngnss_rate_hz = 10\n").imus[0].navigator.is_on);
  EXPECT_FALSE(load("solution = \"filter\"\n").imus[0].navigator.estimates_scale_factors);
  EXPECT_TRUE(
      load("solution = \"filter\"\nestimate_scale_factors = true\n").imus[0].navigator.estimates_scale_factors);
  const ImuConfig antennas = load("solution = \"truth\"\nantennas_heading_deg = 1\n").imus[0];
  EXPECT_FALSE(antennas.navigator.is_on);
  const auto warnings = [&](const std::string& key) { return load("solution = \"attitude\"\n" + key).warnings; };
  const std::vector<std::string> of_antennas = warnings("antennas_heading_deg = 1\n");
  ASSERT_EQ(of_antennas.size(), warnings("").size() + 1);
  EXPECT_TRUE(std::ranges::any_of(of_antennas, [](const std::string& warning) {
    return contains(warning, "antennas_heading_deg: is only reported, as the receiver's");
  }));
  EXPECT_EQ(antennas.model.navigation.antennas_heading, units::degree);
  for (const char* wrong : {"solution = \"kalman\"\n", "gnss_rate_hz = 5\n", "barometer_rate_hz = 5\n",
                            "solution = \"filter\"\nantennas_heading_deg = 1\ngnss_rate_hz = 0\n",
                            "solution = \"filter\"\nbarometric_height_m = 0\n",
                            "solution = \"attitude\"\nestimate_scale_factors = true\n",
                            "solution = \"filter\"\nheading_deg = 1\n", "solution = \"filter\"\nalignment_s = 0\n"})
    EXPECT_THROW(load(wrong), ConfigError) << wrong;
  const std::string nowhere =
      config_text("[earth]\nframe = \"none\"\n", "vectornav", 1, "[imu.navigation]\nsolution = \"filter\"\n");
  EXPECT_THROW(load_config(write("nowhere.toml", nowhere)), ConfigError);
}

// An INS and an AHRS compute their solutions unless the truth has no places, or they have no errors of a preset, or
// given errors of the attitude.
TEST_F(SolutionTest, IsTheUnitsOwnByDefault) {
  using Kind = NavigatorModel::Kind;
  const auto solution_of = [&](const char* earth, const std::string& protocol, const std::string& keys,
                               const char* truth = "") {
    const Config config = load_config(write("default.toml", config_text(earth, protocol, 1, keys, truth)));
    const NavigatorModel& navigator = config.imus[0].navigator;
    return navigator.is_on ? std::optional(navigator.kind) : std::nullopt;
  };
  constexpr const char *inertial = "[earth]\nframe = \"inertial\"\n", *nowhere = "[earth]\nframe = \"none\"\n";
  struct Unit {
    const char *protocol, *model;
    Kind kind;
  };
  for (const Unit& unit : {Unit{"vectornav", "vn-100", Kind::attitude}, Unit{"vectornav", "vn-200", Kind::inertial},
                           Unit{"vectornav", "vn-300", Kind::inertial}, Unit{"mip", "3dm-gx5-25", Kind::attitude},
                           Unit{"mip", "3dm-gx5-45", Kind::inertial}, Unit{"mip", "3dm-cv7-ahrs", Kind::attitude},
                           Unit{"mip", "3dm-cv7-ins", Kind::inertial}, Unit{"mip", "3dm-gq7", Kind::inertial}}) {
    const std::string model = fmt::format("device.model = \"{}\"\n", unit.model);
    EXPECT_EQ(solution_of(inertial, unit.protocol, model), unit.kind) << unit.model;
    EXPECT_EQ(solution_of("", unit.protocol, model), unit.kind) << unit.model << ": JSBSim's truth has places";
    EXPECT_FALSE(solution_of(nowhere, unit.protocol, model)) << unit.model;
    EXPECT_FALSE(solution_of(inertial, unit.protocol, model, "specific_force = \"none\"\n")) << unit.model;
    for (const char* keys : {"model = \"ideal\"\n", "model = \"white\"\n", "navigation.heading_deg = 1\n",
                             "navigation.roll_pitch_deg = 1\n", "navigation.solution = \"truth\"\n"})
      EXPECT_FALSE(solution_of(inertial, unit.protocol, model + keys)) << unit.model << ": " << keys;
    EXPECT_EQ(solution_of(inertial, unit.protocol, model + "model = \"bmi088\"\n"), unit.kind) << unit.model;
  }
  EXPECT_EQ(solution_of(inertial, "sbg-can", ""), Kind::inertial);
  EXPECT_EQ(solution_of(inertial, "xsens-can", ""), Kind::attitude);
  EXPECT_FALSE(solution_of(inertial, "stim300", ""));
}

}  // namespace
}  // namespace imud
