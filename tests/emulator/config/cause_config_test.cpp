// [[imu.cause]]: the loads in the model, what is refused, and the names in summary and labels.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <fstream>
#include <string>
#include <utility>
#include <vector>

#include "emulator/config/load_config.hpp"
#include "emulator/ground/drawn_terms.hpp"
#include "emulator/plan/config.hpp"
#include "tests/transports/scratch_folder.hpp"

namespace imud {
namespace {

class CauseConfig : public testing::Test {
 protected:
  Config load(const std::string& keys) const {
    std::ofstream(path_) << "[truth]\nport = \"udp:127.0.0.1:9810\"\n[[imu]]\nrate_hz = 200\nprotocol = \"native\"\n"
                            "port = \"pty:imu1\"\ngyro.max_rad_per_s = 10\naccelerometer.max_m_per_s2 = 200\n"
                            "gyro.unit_sigma.bias_deg_per_hr = 10\ngyro.unit_sigma.misalignment_mrad = 1\n"
                            "gyro.unit_sigma.scale_factor_ppm = [100, 0, 100]\n"
                            "gyro.turn_on_bias_deg_per_hr = 5\ngyro.turn_on_sigma.scale_factor_ppm = 10\n"
                            "accelerometer.unit_sigma.temperature_bias_mg_per_c2 = 1\n"
                            "accelerometer.unit_sigma.vibration_rectification_ug_per_g2 = 1\n"
                            "magnetometer.unit_sigma.bias_ut = 1\n"
                         << keys;
    return load_config(path_);
  }
  ImuModel model(const std::string& keys) const { return load(keys).imus.at(0).model; }
  std::string fault(const std::string& keys) const {
    try {
      load(keys);
    } catch (const ConfigError& error) {
      return error.what();
    }
    return "no fault";
  }

  ScratchFolder folder_;
  const std::string path_ = folder_ / "config.toml";
  const std::string two_causes_ =
      "[[imu.cause]]\nname = \"stress\"\ngyro.bias = [0.8, -0.5, 0]\ngyro.misalignment = 0.3\n"
      "accelerometer.temperature_bias_per_c2 = -0.4\naccelerometer.vibration_rectification = [0.1, 0.2, 0.3]\n"
      "magnetometer.bias = 1\n[[imu.cause]]\nname = \"start\"\nlayer = \"turn_on\"\nper_axis = true\n"
      "gyro.bias = -1\ngyro.scale_factor = 0.6\n";
};

// A STIM300 has inclinometers, whose drawn errors a cause may share; with another unit a load finds no errors.
TEST_F(CauseConfig, IsOfInclinometersToo) {
  const std::string cause = "[[imu.cause]]\nname = \"stress\"\ninclinometer.scale_factor = 0.5\n";
  EXPECT_NE(fault(cause).find("inclinometer: scale_factor of the x axis has no standard deviation to share"),
            std::string::npos)
      << fault(cause);
  std::ofstream(path_) << "[truth]\nport = \"udp:127.0.0.1:9810\"\n[[imu]]\nprotocol = \"stim300\"\n"
                          "port = \"pty:imu1\"\n"
                       << cause;
  const ImuModel stim300 = load_config(path_).imus.at(0).model;
  EXPECT_EQ(stim300.causes.at(0).loads(Quantity::inclination).scale_factor, Vector3::Constant(0.5));
  EXPECT_FALSE(stim300.causes.at(0).loads(Quantity::specific_force).is_on());
  std::string sensors;
  for (const DrawnTerms& drawn : drawn_terms(stim300, 1, "imu1"))
    sensors += fmt::format("{}.{} ", drawn.sensor, drawn.layer);
  EXPECT_NE(sensors.find("inclinometer.unit"), std::string::npos) << sensors;
}

TEST_F(CauseConfig, LoadsAreOfTheElementsOfTheirTerms) {
  const ImuModel m = model(two_causes_);
  ASSERT_EQ(m.causes.size(), 2U);
  const Cause &stress = m.causes[0], &start = m.causes[1];
  EXPECT_EQ(stress.name, "stress");
  EXPECT_TRUE(stress.layer == DrawnLayer::unit && !stress.is_per_axis);
  EXPECT_EQ(stress.gyro.bias, Vector3(0.8, -0.5, 0));
  Matrix3 misalignment;
  misalignment << 0, 0.3, 0.3, 0.3, 0, 0.3, 0.3, 0.3, 0;
  EXPECT_EQ(stress.gyro.misalignment, misalignment);
  EXPECT_EQ(stress.accelerometer.temperature_bias.col(1), Vector3::Constant(-0.4));
  EXPECT_TRUE(stress.accelerometer.temperature_bias.col(0).isZero(0));
  EXPECT_EQ(stress.accelerometer.vibration_rectification, Matrix3(Vector3(0.1, 0.2, 0.3).asDiagonal()));
  EXPECT_EQ(stress.magnetometer.bias, Vector3::Ones());
  EXPECT_TRUE(start.layer == DrawnLayer::turn_on && start.is_per_axis);
  EXPECT_EQ(start.gyro.bias, -Vector3::Ones());
  EXPECT_FALSE(start.accelerometer.is_on());
  EXPECT_TRUE(model("").causes.empty());
}

// The output of `imud check --toml` is a configuration for the same run.
TEST_F(CauseConfig, ResolvedKeysMakeTheSameCauses) {
  const Config config = load(two_causes_);
  const Config again = config_of_text(config.resolved());
  EXPECT_EQ(again.resolved(), config.resolved());
  ASSERT_EQ(again.imus.at(0).model.causes.size(), 2U);
  EXPECT_EQ(again.imus.at(0).model.causes[0].gyro.misalignment, config.imus[0].model.causes[0].gyro.misalignment);
}

TEST_F(CauseConfig, WhatNoDrawCanHaveIsRefused) {
  const std::string one = "[[imu.cause]]\nname = \"a\"\ngyro.bias = 0.8\n";
  for (const auto& [keys, expected] : std::vector<std::pair<std::string, std::string>>{
           {"[imu.cause]\nname = \"a\"\n", "imu.0.cause: give tables, each as [[imu.cause]]"},
           {"[[imu.cause]]\ngyro.bias = 0.8\n", "imu.0.cause.0.name: missing; give the cause's"},
           {"[[imu.cause]]\nname = \"a b\"\ngyro.bias = 0.8\n", "imu.0.cause.0.name: give up to 40 letters"},
           {"[[imu.cause]]\nname = \"a\"\n", "imu.0.cause.0.name: needs loads"},
           {one + one, "imu.0.cause.1.name: gives the random numbers of the cause \"a\"; give another"},
           {one + "layer = \"day\"\n", "imu.0.cause.0.layer: give one of \"unit\", \"turn_on\""},
           {one + "gyro.misalignment = 1.1\n",
            "imu.0.cause.0.gyro.misalignment: give three numbers, [x, y, z], from -1"},
           {one + "accelerometer.g_sensitivity = 0.1\n", "imu.0.cause.0.accelerometer.g_sensitivity: unknown key"},
           {one + "gyro.scale_factor = 0.5\n",
            "imu.0.cause.0.gyro: scale_factor of the y axis has no standard "
            "deviation to share; give it in gyro.unit_sigma"},
           {one + "accelerometer.bias = [0, 0, 1]\n", "imu.0.cause.0.accelerometer: bias of the z axis has no"},
           {"[[imu.cause]]\nname = \"a\"\nlayer = \"turn_on\"\naccelerometer.bias = 0.5\n",
            "bias of the x axis has no standard deviation to share; give accelerometer.turn_on_bias_*"},
           {one + "[[imu.cause]]\nname = \"b\"\ngyro.bias = [0, 0.8, 0]\n",
            "imu.0.cause.1.gyro: the squares of the loads of bias of the y axis add up to 1.28; give loads whose "
            "squares add up to at most 1 over all causes"},
       })
    EXPECT_NE(fault(keys).find(expected), std::string::npos) << fault(keys) << "\nfor: " << expected;
  // The layers are apart, and 0.8^2 + 0.6^2 is 1.
  EXPECT_EQ(fault(one + "[[imu.cause]]\nname = \"b\"\ngyro.bias = 0.6\n[[imu.cause]]\nname = \"c\"\n"
                        "layer = \"turn_on\"\ngyro.bias = 1\n"),
            "no fault");
}

TEST_F(CauseConfig, CausesAreDrawnByTheirNames) {
  const std::vector<DrawnTerms> all = drawn_terms(model(two_causes_), 1, "imu1");
  std::string causes;
  for (const DrawnTerms& drawn : all) {
    if (drawn.sensor != "cause") continue;
    causes += fmt::format("{}:", drawn.layer);
    for (const auto& [name, values] : drawn.terms) causes += fmt::format(" {} {}", name, values.size());
    causes += "\n";
  }
  EXPECT_EQ(causes, "unit: stress 1\nturn_on: start 3\n");
  // By the causes alone, the bias of the power on is -5 deg/h and the bias of the magnetometer 1 uT.
  const auto values = [&](std::string_view sensor, std::string_view layer, std::string_view name) {
    for (const DrawnTerms& drawn : all)
      for (const auto& [term, list] : drawn.terms)
        if (drawn.sensor == sensor && drawn.layer == layer && term == name) return list;
    return std::vector<double>(3, 0.0);
  };
  const std::vector<double> start = values("cause", "turn_on", "start"), bias = values("gyro", "turn_on", "bias");
  for (std::size_t i = 0; i < 3; ++i) EXPECT_NEAR(bias.at(i), -5 * 4.84813681109536e-6 * start.at(i), 1e-18);
  EXPECT_NEAR(values("magnetometer", "unit", "bias").at(2), 1e-6 * values("cause", "unit", "stress").at(0), 1e-18);
}

}  // namespace
}  // namespace imud
