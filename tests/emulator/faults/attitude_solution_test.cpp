// The solution of a unit that computes its attitude alone, in a flight, with faults of its sensors and of its power.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

#include "tests/emulator/faults/faulty_run.hpp"

namespace imud {
namespace {

// A line of text of a described unit.
struct Reported {
  double time = 0, state = 0, roll = 0, pitch = 0, yaw = 0, sigma = 0, latitude = 0;
};

class AttitudeSolutionTest : public FaultyRunTest {
 protected:
  std::vector<Reported> fly(const std::string& solution, const std::string& faults = "",
                            const std::string& truth = "") {
    const std::string file = write(
        "ahrs.toml",
        "frame_version = 1\nname = \"ahrs\"\n[[message]]\ntext = \"$AHRS,{time_s:.3f},{navigation_state:.0f},"
        "{roll_deg:.4f},{pitch_deg:.4f},{yaw_deg:.4f},{attitude_sigma_north_deg:.4f},{latitude_deg:.6f}\\r\\n\"\n");
    const Result result =
        run(faults, "frame", 1,
            "rate_hz = 50\nmodel = \"vn-100\"\ndevice.frame_file = \"" + file + "\"\n[imu.navigation]\n" + solution,
            truth);
    std::vector<Reported> all;
    for (const Sent& sent : result.frames) {
      Reported r;
      if (std::sscanf(sent.bytes.c_str(), "$AHRS,%lf,%lf,%lf,%lf,%lf,%lf,%lf", &r.time, &r.state, &r.roll, &r.pitch,
                      &r.yaw, &r.sigma, &r.latitude) == 7)
        all.push_back(r);
    }
    EXPECT_GE(all.size(), 380U);
    return all;
  }
  static std::string attitude() { return "solution = \"attitude\"\n"; }
  // Degrees between two directions about the same axis.
  static double apart(double a, double b) { return std::abs(std::remainder(a - b, 360.0)); }
  static double largest_tilt(const std::vector<Reported>& a, const std::vector<Reported>& b, std::size_t from,
                             std::size_t to) {
    double largest = 0;
    for (std::size_t i = from; i < std::min(to, a.size()); ++i)
      largest = std::max({largest, apart(a[i].roll, b[i].roll), apart(a[i].pitch, b[i].pitch)});
    return largest;
  }
};

TEST_F(AttitudeSolutionTest, LevelsThenFollows) {
  const std::vector<Reported> truth = fly(""), solution = fly(attitude());
  ASSERT_EQ(truth.size(), solution.size());
  std::size_t aligning = 0;
  for (std::size_t i = 0; i < truth.size(); ++i) {
    EXPECT_EQ(truth[i].state, 0);
    EXPECT_EQ(solution[i].latitude, truth[i].latitude);  // the place is no part of it
    EXPECT_NE(solution[i].latitude, 0);
    aligning += solution[i].state == 1 ? 1 : 0;
    if (solution[i].state == 1) continue;
    ASSERT_EQ(solution[i].state, 4) << i;
    EXPECT_GT(solution[i].sigma, 0.1);
    EXPECT_LT(solution[i].sigma, 5);
    EXPECT_LT(apart(solution[i].yaw, truth[i].yaw), 12) << i;
  }
  EXPECT_EQ(aligning, 50U);
  EXPECT_LT(largest_tilt(solution, truth, 50, 500), 6);  // the vehicle accelerates
}

// Without a place there is no field: the tilt is the same, and the heading begins at 0.
TEST_F(AttitudeSolutionTest, NeedsNoPlace) {
  const std::vector<Reported> with = fly(attitude()), without = fly(attitude(), "[earth]\nframe = \"none\"\n");
  ASSERT_EQ(with.size(), without.size());
  EXPECT_LT(largest_tilt(with, without, 50, 500), 0.5);
  for (std::size_t i = 51; i < without.size(); ++i) {
    ASSERT_EQ(without[i].state, 4) << i;
    EXPECT_EQ(without[i].latitude, 0);
    // The headings differ by the first, which the gyros keep.
    EXPECT_LT(apart(with[i].yaw - without[i].yaw, with[51].yaw - without[51].yaw), 4) << i;
  }
  EXPECT_LT(apart(without[51].yaw, 0), 1);
}

// Faults of gyro and power show in the attitude and in the state.
TEST_F(AttitudeSolutionTest, FaultsShow) {
  const std::string bias =
      "[[fault]]\ntarget = \"gyro.x\"\nkind = \"bias\"\nvalue_deg_per_s = 8\nat_s = 4\nfor_s = 3\n";
  const std::vector<Reported> whole = fly(attitude()), solution = fly(attitude(), bias), truth = fly("", bias);
  ASSERT_EQ(whole.size(), solution.size());
  EXPECT_EQ(largest_tilt(solution, whole, 0, 199), 0);
  EXPECT_GT(largest_tilt(solution, whole, 200, 500), 15);
  EXPECT_EQ(largest_tilt(truth, fly(""), 0, 500), 0);  // the truth does not notice
  const std::vector<Reported> off =
      fly(attitude(), "[[fault]]\ntarget = \"power\"\nkind = \"off\"\nat_s = 4\nfor_s = 0.5\n");
  std::vector<double> aligning;
  for (const Reported& one : off)
    if (one.state == 1) aligning.push_back(one.time);
  ASSERT_EQ(aligning.size(), 100U);
  EXPECT_NEAR(aligning[50] - aligning[49], 3.5, 0.1);
}

// With poses alone the specific force is derived; it must have gravity in it.
TEST_F(AttitudeSolutionTest, WorksWithPosesAlone) {
  const std::string poses = "rate = \"derived\"\nspecific_force = \"derived\"\n";
  const std::vector<Reported> given = fly(attitude()), derived = fly(attitude(), "", poses);
  ASSERT_EQ(given.size(), derived.size());
  EXPECT_LT(largest_tilt(given, derived, 50, 500), 1);
  const auto load = [&](const std::string& truth, const std::string& keys) {
    return load_config(write("off.toml", config_text("[imu.navigation]\n" + keys, "vectornav", 1, "", truth)));
  };
  const auto refusal = [&](const std::string& truth, const std::string& keys = attitude()) -> std::string {
    try {
      load(truth, keys);
    } catch (const ConfigError& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_EQ(refusal("gravity = \"none\"\nspecific_force = \"given\"\n"), "");
  EXPECT_EQ(refusal(poses + "gravity_m_per_s2 = 3.7\n"), "");
  for (const std::string off : {"gravity = \"none\"\n", "gravity_m_per_s2 = 0\n"})
    EXPECT_NE(refusal(poses + off).find("levels by gravity"), std::string::npos) << off;
  EXPECT_NE(refusal("specific_force = \"none\"\n").find("levels by the specific force"), std::string::npos);
  for (const char* wrong : {"gnss_rate_hz = 5\n", "roll_pitch_deg = 1\n", "quiet_m_per_s2 = 0\n"})
    EXPECT_NE(refusal("", attitude() + wrong), "") << wrong;
  EXPECT_NE(refusal("", "solution = \"filter\"\nquiet_m_per_s2 = 0.1\n"), "");
  EXPECT_NE(refusal("", "solution = \"truth\"\nquiet_m_per_s2 = 0.1\n"), "");
  const NavigatorModel navigator =
      load("", attitude() + "quiet_m_per_s2 = 0.1\nmagnetic_rate_hz = 0\nposition_noise_m = 1\n").imus[0].navigator;
  EXPECT_TRUE(navigator.is_on);
  EXPECT_EQ(navigator.kind, NavigatorModel::Kind::attitude);
  EXPECT_EQ(navigator.quiet_acceleration, 0.1);
}

}  // namespace
}  // namespace imud
