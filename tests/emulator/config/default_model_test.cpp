// The model whose errors a product has if its configuration names none.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "core/units.hpp"
#include "emulator/config/load_config.hpp"
#include "emulator/config/presets.hpp"
#include "emulator/plan/config.hpp"
#include "tests/support/text.hpp"
#include "tests/tools/run_program.hpp"
#include "tests/transports/scratch_folder.hpp"

namespace imud {
namespace {

constexpr double deg = units::degree, g = units::standard_gravity;

class DefaultModel : public testing::Test {
 protected:
  std::string configuration(const std::string& protocol) const {
    return "[truth]\nport = \"udp:127.0.0.1:9810\"\n[[imu]]\nprotocol = \"" + protocol + "\"\nport = \"" +
           (find_protocol(protocol)->link == Link::can ? "can:vcan0" : "pty:imu1") + "\"\n";
  }
  ImuConfig imu(const std::string& protocol, const std::vector<std::string>& assignments = {}) const {
    std::ofstream(path_) << configuration(protocol);
    std::vector<std::string> all;
    for (const std::string& assignment : assignments) all.push_back("imu.0." + assignment);
    return load_config(path_, all).imus.at(0);
  }
  std::string fault(const std::string& protocol, const std::vector<std::string>& assignments) const {
    try {
      imu(protocol, assignments);
    } catch (const ConfigError& error) {
      return error.what();
    }
    return "no fault";
  }

  ScratchFolder folder_;
  const std::string path_ = folder_ / "config.toml";
};

// Returns the names of the members that differ.
std::string differences(const TriadErrors& a, const TriadErrors& b) {
  std::string names;
  const auto compare = [&](const char* name, const auto& one, const auto& other) {
    if (!(one == other)) names += std::string(name) + " ";
  };
  compare("misalignment", a.misalignment, b.misalignment);
  compare("scale_factor", a.scale_factor, b.scale_factor);
  compare("asymmetry", a.scale_factor_asymmetry, b.scale_factor_asymmetry);
  compare("quadratic", a.quadratic, b.quadratic);
  compare("cubic", a.cubic, b.cubic);
  compare("bias", a.bias, b.bias);
  compare("walk_transition", a.walk_transition, b.walk_transition);
  compare("walk_sqrt_cov", a.walk_sqrt_cov, b.walk_sqrt_cov);
  compare("walk_bound", a.walk_bound, b.walk_bound);
  compare("turn_on_bias", a.turn_on_bias, b.turn_on_bias);
  compare("ramp", a.ramp, b.ramp);
  compare("g_sensitivity", a.g_sensitivity, b.g_sensitivity);
  compare("g_squared_sensitivity", a.g_squared_sensitivity, b.g_squared_sensitivity);
  compare("white_density", a.white_density, b.white_density);
  compare("bias_instability", a.bias_instability, b.bias_instability);
  compare("flicker_from_s", a.flicker_from_s, b.flicker_from_s);
  compare("flicker_to_s", a.flicker_to_s, b.flicker_to_s);
  compare("correlated_sigma", a.correlated_sigma, b.correlated_sigma);
  compare("correlation_time", a.correlation_time, b.correlation_time);
  compare("random_walk_density", a.random_walk_density, b.random_walk_density);
  compare("lsb", a.lsb, b.lsb);
  compare("rounding", a.rounding, b.rounding);
  compare("carry", a.carry, b.carry);
  compare("max", a.max, b.max);
  compare("increment_lsb", a.increment_lsb, b.increment_lsb);
  return names;
}

TEST_F(DefaultModel, IsTheProductsPreset) {
  struct Case {
    const char *protocol, *setting, *preset;
  };
  const Case cases[] = {
      {"stim300", "", "stim300"},
      {"vectornav", "", "vn-100"},
      {"vectornav", "device.model=vn-300", "vn-100"},
      {"mip", "", "3dm-gx5-25"},
      {"mip", "device.model=3dm-gx5-45", "3dm-gx5-25"},
      {"mip", "device.model=3dm-cv7-ahrs", "3dm-cv7"},
      {"mip", "device.model=3dm-cv7-ins", "3dm-cv7"},
      {"mip", "device.model=3dm-gq7", "3dm-cv7"},
      {"xsens-can", "", "mti-630"},
      {"sbg-can", "", "sbg-ellipse"},
      {"dronecan", "", "icm-42688-p"},
      {"j1939", "", "white"},
      {"bosch-mm7", "", "white"},
      {"nos3-imu", "", "white"},
  };
  for (const Case& c : cases) {
    std::vector<std::string> keys;
    if (*c.setting != '\0') keys.emplace_back(c.setting);
    const ImuConfig made = imu(c.protocol, keys);
    EXPECT_EQ(made.errors_model, c.preset) << c.protocol << " " << c.setting;
    const Preset* preset = find_preset(c.preset);
    if (preset == nullptr) continue;
    // The preset's errors with the product's range and resolution.
    const Product product = made.protocol->product(made.settings);
    PresetErrors expected = preset_errors(*preset, made.rate_hz);
    for (const auto& [errors, own] :
         {std::pair(&expected.gyro, product.gyro), std::pair(&expected.accelerometer, product.accelerometer)}) {
      errors->max = own.max;
      errors->lsb = own.lsb;
      errors->rounding = own.rounding;
      errors->increment_lsb = own.increment_lsb;
    }
    EXPECT_EQ(differences(made.model.gyro, expected.gyro), "") << c.protocol << " " << c.setting;
    EXPECT_EQ(differences(made.model.accelerometer, expected.accelerometer), "") << c.protocol << " " << c.setting;
    EXPECT_EQ(differences(made.model.magnetometer, product.magnetometer), "") << c.protocol;
    EXPECT_EQ(made.model.barometer.noise, product.barometer.noise) << c.protocol;
  }
  // Every product that names a preset is among the cases, and each of its names is one.
  for (const Protocol* protocol : protocols())
    if (protocol->preset != nullptr && protocol->product != nullptr) {
      EXPECT_TRUE(std::any_of(std::begin(cases), std::end(cases), [&](const Case& c) {
        return protocol->name == c.protocol;
      })) << protocol->name;
      EXPECT_NE(find_preset(protocol->preset(Settings(protocol->settings))), nullptr) << protocol->name;
    }
}

TEST_F(DefaultModel, WhiteIsWhatProductsHad) {
  for (const Protocol* protocol : protocols()) {
    if (protocol->product == nullptr) continue;
    const Product product = protocol->product(Settings(protocol->settings));
    const ImuConfig made = imu(std::string(protocol->name), {"model=white"});
    EXPECT_EQ(made.errors_model, "white");
    EXPECT_EQ(differences(made.model.gyro, product.gyro), "") << protocol->name;
    EXPECT_EQ(differences(made.model.accelerometer, product.accelerometer), "") << protocol->name;
    EXPECT_EQ(differences(made.model.magnetometer, product.magnetometer), "") << protocol->name;
  }
}

TEST_F(DefaultModel, IdealHasOnlyTheRange) {
  for (const Protocol* protocol : protocols()) {
    if (protocol->product == nullptr) continue;
    const Product product = protocol->product(Settings(protocol->settings));
    TriadErrors gyro, accelerometer;
    gyro.max = product.gyro.max;
    accelerometer.max = product.accelerometer.max;
    const ImuConfig made = imu(std::string(protocol->name), {"model=ideal"});
    EXPECT_EQ(differences(made.model.gyro, gyro), "") << protocol->name;
    EXPECT_EQ(differences(made.model.accelerometer, accelerometer), "") << protocol->name;
  }
}

TEST_F(DefaultModel, AKeyTakesThePlaceOfItsOwnValueOnly) {
  // adis16470 has a range, a density that is one-sided, a bias instability, an LSB and its rounding.
  const std::map<std::string, std::string> keys = {
      {"max_deg_per_s=100", "max "},
      {"bias_deg_per_hr=1", "bias "},
      {"turn_on_bias_deg_per_hr=1", "turn_on_bias "},
      {"scale_factor=[1.01,1,1]", "scale_factor "},
      {"misalignment=[[1,0.01,0],[0,1,0],[0,0,1]]", "misalignment "},
      {"angle_random_walk_deg_per_rt_hr=1", "white_density "},
      {"noise_density_deg_per_s_per_rt_hz=1", "white_density "},
      {"bias_instability_deg_per_hr=1", "bias_instability "},
      {"bias_instability_from_s=2", "flicker_from_s "},
      {"bias_instability_to_s=2000", "flicker_to_s "},
      {"correlated_noise_deg_per_hr=1", "correlated_sigma "},
      {"correlation_time_s=2", "correlation_time "},
      {"rate_random_walk_deg_per_hr_per_rt_hr=1", "random_walk_density "},
      {"rate_ramp_deg_per_hr_per_hr=1", "ramp "},
      {"g_sensitivity_deg_per_hr_per_g=1", "no fault"},
      {"lsb_deg_per_s=1", "lsb "},
      {"rounding=toward_zero", "rounding "},
      {"carry=true", "carry "},
      {"lsb_delta_angle_rad=1e-6", "increment_lsb "},
      {"walk_transition=[0,0,0]", "walk_transition "},
      {"walk_sqrt_cov=[1e-3,0,0]", "walk_sqrt_cov "},
      {"walk_bound=[1,1,1]", "walk_bound "},
  };
  const std::string model = "model=adis16470";
  const ImuConfig preset = imu("vectornav", {model});
  EXPECT_EQ(preset.model.gyro.rounding, Rounding::nearest);
  for (const auto& [key, changed] : keys) {
    if (changed == "no fault") continue;
    const ImuConfig made = imu("vectornav", {model, "gyro." + key});
    EXPECT_EQ(differences(made.model.gyro, preset.model.gyro), changed) << key;
    EXPECT_EQ(differences(made.model.accelerometer, preset.model.accelerometer), "") << key;
  }
}

// The key qualifies the density of the same table, that of the preset included.
TEST_F(DefaultModel, SidednessIsAKeyOfItsOwn) {
  const auto density = [&](const std::vector<std::string>& keys) {
    return imu("vectornav", keys).model.gyro.white_density.x() / deg;
  };
  const std::string one_sided = "model=adis16470";  // 0.008 deg/s/sqrt(Hz)
  EXPECT_NEAR(density({one_sided}), 0.008 / std::sqrt(2.0), 1e-12);
  EXPECT_NEAR(density({one_sided, "gyro.noise_density_deg_per_s_per_rt_hz=0.01"}), 0.01 / std::sqrt(2.0), 1e-12);
  EXPECT_NEAR(density({one_sided, "gyro.noise_density_sidedness=two_sided"}), 0.008, 1e-12);
  EXPECT_NEAR(density({one_sided, "gyro.angle_random_walk_deg_per_rt_s=0.01"}), 0.01, 1e-12);
  EXPECT_NEAR(density({"gyro.noise_density_sidedness=one_sided"}), 0.0035 / std::sqrt(2.0), 1e-12);
  EXPECT_NEAR(density({"model=adis16505-1", "gyro.noise_density_sidedness=one_sided"}), 0.13 / 60, 1e-12)
      << "stated by the random walk";
}

// Another sensor in the place of the product's own: its resolution, and its range within the product's.
TEST_F(DefaultModel, AnotherPresetIsLimitedToTheProductsRange) {
  const ImuModel slow = imu("vectornav", {"model=hg4930-ca51"}).model;
  EXPECT_NEAR(slow.gyro.max, 400 * deg, 1e-12);
  EXPECT_NEAR(slow.accelerometer.max, 16 * g, 1e-12);
  EXPECT_NEAR(slow.gyro.lsb, 600 * 0x1p-20, 1e-12);
  EXPECT_NEAR(imu("stim300", {"model=adis16470", "device.accelerometer_range_g=5"}).model.accelerometer.max,
              imu("stim300", {"device.accelerometer_range_g=5"}).model.accelerometer.max, 1e-12);
  EXPECT_EQ(imu("stim300", {"model=adis16470", "accelerometer.max_g=40"}).model.accelerometer.max, 40 * g);
}

// A product at a rate for which the shortest averaging time of the preset is too short.
TEST_F(DefaultModel, FitsTheLowestRate) {
  for (const Protocol* protocol : protocols()) {
    if (protocol->preset == nullptr) continue;
    for (const Setting& setting : protocol->settings)
      if (setting.key == "output_rate_hz" || setting.key == "sample_rate_hz") {
        std::vector<std::string> keys = {"device." + std::string(setting.key) + "=1"};
        if (protocol->name == "dronecan") keys.emplace_back("device.raw_imu_hz=1");
        EXPECT_EQ(fault(std::string(protocol->name), keys), "no fault");
      }
  }
  const std::string model = "model=3dm-cv7", rate = "device.output_rate_hz=1";
  const TriadErrors slow = imu("sbg-can", {model, rate}).model.gyro;
  EXPECT_GT(slow.flicker_from_s, 2);
  EXPECT_LT(slow.flicker_from_s, 10);
  EXPECT_EQ(slow.flicker_to_s, 1000);
  EXPECT_EQ(imu("sbg-can", {model}).model.gyro.flicker_from_s, 1);
  EXPECT_NE(fault("sbg-can", {model, rate, "gyro.bias_instability_from_s=1"})
                .find("imu.0.gyro.bias_instability_from_s: too short for a sensor of 1 Hz"),
            std::string::npos);
}

TEST_F(DefaultModel, IsInListExampleCheckAndLog) {
  EXPECT_NE(
      run_program("imud", {"list", "mip"}).output.find("model in [[imu]]: 3dm-gx5-25 or 3dm-cv7, by device.model"),
      std::string::npos);
  EXPECT_NE(run_program("imud", {"list", "j1939"}).output.find("model in [[imu]]: white\n"), std::string::npos);
  EXPECT_NE(run_program("imud", {"example", "vectornav"}).output.find("\n#model = \"vn-100\"\n"), std::string::npos);
  std::ofstream(path_) << configuration("vectornav") << "[[imu]]\nprotocol = \"j1939\"\nport = \"can:vcan0\"\n";
  const ProgramResult check = run_program("imud", {"check", path_});
  EXPECT_NE(check.output.find("errors of the model vn-100: VectorNav VN-100"), std::string::npos) << check.output;
  EXPECT_NE(check.output.find("errors of the model white: white noise alone"), std::string::npos) << check.output;
  EXPECT_NE(check.output.find(
                "gyro noise: random walk N 0.21 deg/sqrt(h), bias instability B 15.05 deg/h, minimum 10 deg/h"),
            std::string::npos)
      << check.output;

  const std::string capture = IMUD_TEST_DATA "/captures/jsbsim_c172_10s.pcap?port=5140";
  std::ofstream(path_) << "[truth]\nport = \"udp:127.0.0.1:5140\"\nformat = \"jsbsim\"\n[[imu]]\nprotocol = "
                          "\"vectornav\"\nport = \"file:"
                       << folder_ / "out"
                       << "\"\n";
  const ProgramResult run = run_program("imud", {"replay", path_, capture, "--fast", "--for", "0.1"});
  const std::string line = "info imu1: errors of the model vn-100";
  const std::size_t at = run.errors.find(line);
  ASSERT_NE(at, std::string::npos) << run.errors;
  EXPECT_EQ(run.errors.find(line, at + 1), std::string::npos) << run.errors;
}

// Faults name the key, and the value in it that is right.
TEST_F(DefaultModel, AWrongModelOfAProductIsAFault) {
  EXPECT_NE(
      fault("mip", {"model=3dm-gx5"}).find("imu.0.model: there is no \"3dm-gx5\"; did you mean \"3dm-gx5-25\"?"),
      std::string::npos);
  EXPECT_NE(fault("mip", {"model=5"}).find("imu.0.model: "), std::string::npos);
}

}  // namespace
}  // namespace imud
