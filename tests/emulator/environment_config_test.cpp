// The keys of limits, size effect, vibration, temperature and sampling jitter.
#include <gtest/gtest.h>

#include <fstream>
#include <string>
#include <utility>
#include <vector>

#include "emulator/config.hpp"
#include "tests/transports/scratch_folder.hpp"

namespace imud {
namespace {

class EnvironmentConfig : public testing::Test {
 protected:
  EnvironmentConfig() {
    std::ofstream(path_) << "[truth]\nport = \"udp:127.0.0.1:9810\"\n[[imu]]\nrate_hz = 200\nprotocol = \"native\"\n"
                            "port = \"pty:imu1\"\ngyro.max_rad_per_s = 10\naccelerometer.max_m_per_s2 = 200\n";
  }
  Config config(const std::vector<std::string>& assignments) const {
    std::vector<std::string> all;
    for (const std::string& assignment : assignments) all.push_back("imu.0." + assignment);
    return load_config(path_, all);
  }
  ImuModel model(const std::vector<std::string>& assignments) const { return config(assignments).imus.at(0).model; }
  std::string fault(const std::vector<std::string>& assignments) const {
    try {
      config(assignments);
    } catch (const ConfigError& error) {
      return error.what();
    }
    return "no fault";
  }
  void expect_faults(const std::vector<std::pair<std::vector<std::string>, std::string>>& cases) const {
    for (const auto& [assignments, expected] : cases)
      EXPECT_NE(fault(assignments).find(expected), std::string::npos) << fault(assignments) << "\nfor: " << expected;
  }
  // Returns the model that the resolved configuration gives.
  ImuModel reloaded(const std::vector<std::string>& assignments) const {
    const std::string path = folder_ / "resolved.toml";
    std::ofstream(path) << config(assignments).resolved;
    return load_config(path).imus.at(0).model;
  }

  ScratchFolder folder_;
  const std::string path_ = folder_ / "config.toml";
};

TEST_F(EnvironmentConfig, LimitsAreOfEachAxisAndDirection) {
  EXPECT_EQ(model({}).gyro.max, 10);
  EXPECT_FALSE(model({}).gyro.limits);
  EXPECT_FALSE(model({"gyro.max_rad_per_s=[10,10,10]"}).gyro.limits);
  EXPECT_FALSE(model({"gyro.min_rad_per_s=-10"}).gyro.limits);
  const TriadErrors axes = model({"gyro.max_rad_per_s=[10,20,5]"}).gyro;
  EXPECT_EQ(axes.range().upper, Vector3(10, 20, 5));
  EXPECT_EQ(axes.range().lower, Vector3(-10, -20, -5));
  EXPECT_EQ(axes.max, 20);
  const TriadErrors down = model({"accelerometer.min_g=[-1,-2,0]"}).accelerometer;
  EXPECT_EQ(down.range().upper, Vector3::Constant(200));
  EXPECT_LT((down.range().lower - 9.80665 * Vector3(-1, -2, 0)).norm(), 1e-14);
  const AxisLimits again = reloaded({"gyro.max_rad_per_s=[10,20,5]", "gyro.min_rad_per_s=-3"}).gyro.range();
  EXPECT_EQ(again.upper, Vector3(10, 20, 5));
  EXPECT_EQ(again.lower, Vector3(-3, -3, -3));
  // The deviation is in ppm of each axis' own range.
  const TriadErrors curved = model({"gyro.max_rad_per_s=[10,20,5]", "gyro.quadratic_ppm_of_range=100"}).gyro;
  EXPECT_NEAR(curved.quadratic.y() * 20 * 20, 100e-6 * 20, 1e-15);
}

TEST_F(EnvironmentConfig, ImpossibleLimitsAreFaults) {
  expect_faults(
      {{{"gyro.max_rad_per_s=[1,0,1]"}, "imu.0.gyro.max_rad_per_s: give three numbers"},
       {{"gyro.max_rad_per_s=[1,1]"}, "imu.0.gyro.max_rad_per_s: give three numbers"},
       {{"gyro.min_rad_per_s=1"}, "imu.0.gyro.min_rad_per_s: give three numbers"},
       {{"gyro.min_rad_per_s=-1", "gyro.min_deg_per_s=-1"}, "give either this or min_rad_per_s, not both"}});
}

TEST_F(EnvironmentConfig, PositionsOfAccelerometersAreRows) {
  const std::string key = "mounting.accelerometer_positions_m=";
  const ImuModel m = model({key + "[[0.01,0.02,0.03],[0,0.04,0],[0,0,0.05]]"});
  EXPECT_EQ(Vector3(m.accelerometer_positions.row(0)), Vector3(0.01, 0.02, 0.03));
  EXPECT_EQ(m.accelerometer_positions(1, 1), 0.04);
  EXPECT_NE(fault({key + "[1,2,3]"}).find("accelerometer_positions_m: give three rows"), std::string::npos);
}

}  // namespace
}  // namespace imud
