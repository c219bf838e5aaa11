// The keys of the error terms: each unit of a data sheet, impossible values, and what `imud check` says of them.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <functional>
#include <numbers>
#include <string>
#include <vector>

#include "core/allan_terms.hpp"
#include "emulator/config/load_config.hpp"
#include "emulator/ground/drawn_terms.hpp"
#include "emulator/ground/error_text.hpp"
#include "emulator/plan/config.hpp"
#include "tests/transports/scratch_folder.hpp"

namespace imud {
namespace {

class NoiseConfig : public testing::Test {
 protected:
  NoiseConfig() {
    std::ofstream(path_) << "[truth]\nport = \"udp:127.0.0.1:9810\"\n[[imu]]\nrate_hz = 200\nprotocol = \"native\"\n"
                            "port = \"pty:imu1\"\ngyro.max_rad_per_s = 10\naccelerometer.max_m_per_s2 = 200\n";
  }
  ImuModel model(const std::vector<std::string>& assignments) const {
    std::vector<std::string> all;
    for (const std::string& assignment : assignments) all.push_back("imu.0." + assignment);
    return load_config(path_, all).imus.at(0).model;
  }
  std::string fault(const std::vector<std::string>& assignments) const {
    try {
      model(assignments);
    } catch (const ConfigError& error) {
      return error.what();
    }
    return "no fault";
  }

  ScratchFolder folder_;
  const std::string path_ = folder_ / "config.toml";
};

// Computed by hand: 1 deg = 0.0174532925199433 rad, 1 g = 9.80665 m/s^2, 1 h = 3600 s.
TEST_F(NoiseConfig, EachUnitIsConvertedAsTheStandardHasIt) {
  struct Case {
    std::string key;
    double si;
    std::function<double(const ImuModel&)> value;
  };
  const auto gyro = [](Vector3 TriadErrors::*member) {
    return [=](const ImuModel& m) { return (m.gyro.*member)[1]; };
  };
  const auto force = [](Vector3 TriadErrors::*member) {
    return [=](const ImuModel& m) { return (m.accelerometer.*member)[1]; };
  };
  const auto field = [](Vector3 TriadErrors::*member) {
    return [=](const ImuModel& m) { return (m.magnetometer.*member)[1]; };
  };
  using E = TriadErrors;
  const std::vector<Case> cases = {
      {"gyro.angle_random_walk_rad_per_rt_s", 1, gyro(&E::white_density)},
      {"gyro.angle_random_walk_deg_per_rt_s", 0.0174532925199433, gyro(&E::white_density)},
      {"gyro.angle_random_walk_deg_per_rt_hr", 2.90888208665722e-4, gyro(&E::white_density)},
      {"gyro.noise_density_rad_per_s_per_rt_hz", 1, gyro(&E::white_density)},
      {"gyro.noise_density_deg_per_s_per_rt_hz", 0.0174532925199433, gyro(&E::white_density)},
      {"gyro.noise_density_mdeg_per_s_per_rt_hz", 1.74532925199433e-5, gyro(&E::white_density)},
      {"gyro.noise_density_deg_per_hr_per_rt_hz", 4.84813681109536e-6, gyro(&E::white_density)},
      {"gyro.bias_instability_deg_per_hr", 4.84813681109536e-6, gyro(&E::bias_instability)},
      {"gyro.turn_on_bias_deg_per_s", 0.0174532925199433, gyro(&E::turn_on_bias)},
      {"gyro.correlated_noise_deg_per_hr", 4.84813681109536e-6, gyro(&E::correlated_sigma)},
      {"gyro.rate_random_walk_deg_per_hr_per_rt_hr", 8.08022801849227e-8, gyro(&E::random_walk_density)},
      {"gyro.rate_ramp_deg_per_hr_per_hr", 1.34670466974871e-9, gyro(&E::ramp)},
      {"accelerometer.velocity_random_walk_m_per_s_per_rt_s", 1, force(&E::white_density)},
      {"accelerometer.velocity_random_walk_m_per_s_per_rt_hr", 0.0166666666666667, force(&E::white_density)},
      {"accelerometer.noise_density_ug_per_rt_hz", 9.80665e-6, force(&E::white_density)},
      {"accelerometer.bias_instability_mg", 9.80665e-3, force(&E::bias_instability)},
      {"accelerometer.turn_on_bias_ug", 9.80665e-6, force(&E::turn_on_bias)},
      {"accelerometer.acceleration_random_walk_ug_per_rt_hr", 1.63444166666667e-7, force(&E::random_walk_density)},
      {"accelerometer.acceleration_ramp_mg_per_hr", 2.72406944444444e-6, force(&E::ramp)},
      {"magnetometer.noise_density_nt_per_rt_hz", 1e-9, field(&E::white_density)},
      {"magnetometer.turn_on_bias_ut", 1e-6, field(&E::turn_on_bias)},
  };
  for (const Case& c : cases) {
    const auto relative = [&](double value) { return value / c.si; };
    EXPECT_NEAR(relative(c.value(model({c.key + "=1"}))), 1, 1e-13) << c.key;
    EXPECT_NEAR(relative(c.value(model({c.key + "=[1,3,5]"}))), 3, 1e-13) << c.key;
  }
  EXPECT_GT(cases.size(), 20U);
}

TEST_F(NoiseConfig, AnHourHasTwoSpellings) {
  const auto terms = [&](const std::vector<std::string>& assignments) {
    const TriadErrors e = model(assignments).gyro;
    return std::vector{e.bias_instability.x(), e.white_density.x(), e.ramp.x(), e.g_sensitivity(0, 0)};
  };
  for (const auto& [hr, h] :
       {std::pair{"gyro.bias_instability_deg_per_hr=2", "gyro.bias_instability_deg_per_h=2"},
        {"gyro.angle_random_walk_deg_per_rt_hr=2", "gyro.angle_random_walk_deg_per_rt_h=2"},
        {"gyro.rate_ramp_deg_per_hr_per_hr=2", "gyro.rate_ramp_deg_per_h_per_h=2"},
        {"gyro.g_sensitivity_deg_per_hr_per_g=[1,2,3]", "gyro.g_sensitivity_deg_per_h_per_g=[1,2,3]"}}) {
    EXPECT_EQ(terms({hr}), terms({h}));
    EXPECT_NE(terms({h}), terms({}));
  }
  const std::string twice = fault({"gyro.bias_instability_deg_per_hr=2", "gyro.bias_instability_deg_per_h=2"});
  EXPECT_NE(twice.find("bias_instability_deg_per_h: unknown key; did you mean \"bias_instability_deg_per_hr\"?"),
            std::string::npos)
      << twice;
}

TEST_F(NoiseConfig, AOneSidedDensityIsDividedByRootTwo) {
  const std::string density = "gyro.noise_density_deg_per_s_per_rt_hz=0.008";
  const double two = model({density}).gyro.white_density.x();
  EXPECT_NEAR(two / (0.008 * 0.0174532925199433), 1, 1e-13);
  // ADIS16470: 0.008 deg/s/sqrt(Hz) one-sided is 0.34 deg/sqrt(h).
  const double one = model({density, "gyro.noise_density_sidedness=\"one_sided\""}).gyro.white_density.x();
  EXPECT_NEAR(one / (0.339411254969543 * 2.90888208665722e-4), 1, 1e-12);
}

// With N = 0.15 deg/sqrt(h) and K = 0.3 deg/h/sqrt(h) the curve's minimum is at sqrt(3) N/K = 0.866 h; without
// flicker it is sqrt(2 N K/sqrt(3)) = 0.22795 deg/h. B is by hand: sqrt((0.5^2 - 0.22795^2)/0.441271).
TEST_F(NoiseConfig, TheMinimumOfTheAllanDeviationIsSetByFlicker) {
  const std::vector<std::string> keys = {"gyro.angle_random_walk_deg_per_rt_hr=0.15",
                                         "gyro.rate_random_walk_deg_per_hr_per_rt_hr=0.3"};
  const auto with = [&](const std::string& minimum) {
    std::vector<std::string> all = keys;
    all.push_back(minimum);
    return all;
  };
  const ImuModel m = model(with("gyro.bias_minimum_deg_per_hr=[0.5,0,0.25]"));
  constexpr double deg_per_hr = 4.84813681109536e-6;
  EXPECT_NEAR(m.gyro.bias_instability[0] / deg_per_hr, 0.669919, 1e-5);
  EXPECT_EQ(m.gyro.bias_instability[1], 0);
  const std::array<AllanTerms, 3> terms = allan_terms(m.gyro, 200);
  EXPECT_NEAR(terms[0].minimum() / deg_per_hr, 0.5, 1e-12);
  EXPECT_NEAR(terms[2].minimum() / deg_per_hr, 0.25, 1e-12);
  // The lowest point of the curve itself.
  double lowest = 1e9;
  for (double tau = 1; tau < 1e5; tau *= 1.001) {
    const auto& [N, B, K, Q, R] = terms[0];
    lowest = std::min(lowest, N * N / tau + 2 * std::numbers::ln2 / std::numbers::pi * B * B + K * K * tau / 3);
  }
  EXPECT_NEAR(std::sqrt(lowest) / deg_per_hr, 0.5, 1e-6);
  // Without N and K it is flicker's alone.
  EXPECT_NEAR(model({"accelerometer.bias_minimum_mg=0.05"}).accelerometer.bias_instability[1] / 9.80665e-3,
              0.05 / 0.664282, 1e-6);
  EXPECT_NE(fault(with("gyro.bias_minimum_deg_per_hr=0.2"))
                .find("imu.0.gyro.bias_minimum_deg_per_hr: white noise and random walk alone make a minimum of "
                      "0.228; give at least that, or 0"),
            std::string::npos)
      << fault(with("gyro.bias_minimum_deg_per_hr=0.2"));
  const std::string both = fault({"gyro.bias_minimum_deg_per_hr=1", "gyro.bias_instability_deg_per_hr=1"});
  EXPECT_NE(both.find("bias_minimum_deg_per_hr: give either this or bias_instability_deg_per_hr, not both"),
            std::string::npos)
      << both;
}

TEST_F(NoiseConfig, ResponseKeysAreOfTheRange) {
  const ImuModel m =
      model({"gyro.quadratic_ppm_of_range=100", "gyro.cubic_ppm_of_range=-50",
             "gyro.scale_factor_asymmetry_ppm=[1,2,3]", "gyro.g_sensitivity_deg_per_hr_per_g=[1,2,3]"});
  // At the range of 10 rad/s the deviation is 100 ppm, or -50 ppm, of 10 rad/s.
  EXPECT_NEAR(m.gyro.quadratic.x() * 100, 1e-3, 1e-15);
  EXPECT_NEAR(m.gyro.cubic.x() * 1000, -5e-4, 1e-15);
  EXPECT_NEAR(m.gyro.scale_factor_asymmetry.z(), 3e-6, 1e-18);
  EXPECT_NEAR(m.gyro.g_sensitivity(1, 1) / (2 * 4.84813681109536e-6 / 9.80665), 1, 1e-13);
  EXPECT_EQ(m.gyro.g_sensitivity(0, 1), 0);
}

// m = M (S B + h) + b, computed by hand.
TEST_F(NoiseConfig, IronIsBeforeTheMagnetometersMisalignment) {
  const TriadErrors m = model({"magnetometer.misalignment=[[1,0.1,0],[0,1,0],[0,0,1]]",
                               "magnetometer.soft_iron=[[1,0,0],[0.5,1.5,0],[0,0,1]]",
                               "magnetometer.hard_iron_ut=[0,20,0]", "magnetometer.bias_ut=[1,0,0]"})
                            .magnetometer;
  Matrix3 expected;
  expected << 1.05, 0.15, 0, 0.5, 1.5, 0, 0, 0, 1;
  EXPECT_LT((m.misalignment - expected).cwiseAbs().maxCoeff(), 1e-15);
  EXPECT_LT((m.bias - Vector3(3e-6, 20e-6, 0)).cwiseAbs().maxCoeff(), 1e-18);
}

TEST_F(NoiseConfig, ImpossibleValuesAreFaultsAtTheirKeys) {
  const std::vector<std::pair<std::vector<std::string>, std::string>> cases = {
      {{"gyro.angle_random_walk_deg_per_rt_hr=-1"}, "imu.0.gyro.angle_random_walk_deg_per_rt_hr: give three numbers"},
      {{"gyro.bias_instability_deg_per_hr=[1,-1,1]"}, "imu.0.gyro.bias_instability_deg_per_hr: give three numbers"},
      {{"gyro.bias_minimum_deg_per_hr=-1"}, "imu.0.gyro.bias_minimum_deg_per_hr: give three numbers"},
      {{"gyro.bias_minimum_deg_per_hr=1", "gyro.bias_minimum_rad_per_s=1"},
       "give either this or bias_minimum_rad_per_s, not both"},
      {{"gyro.bias_instability_deg_per_hr=nan"}, "imu.0.gyro.bias_instability_deg_per_hr: give three numbers"},
      {{"gyro.correlation_time_s=0"}, "imu.0.gyro.correlation_time_s: give three numbers"},
      {{"gyro.misalignment=[[1,0.5,0],[0,1,0],[0,0,1]]"}, "imu.0.gyro.misalignment: an element differs"},
      {{"magnetometer.soft_iron=[[0.5,0.6,0],[0.6,0.5,0],[0,0,1]]"}, "with a determinant above 0"},
      {{"magnetometer.soft_iron=[[2,0,0],[0,1,0],[0,0,1]]"}, "each within 0.9 of the identity's"},
      {{"gyro.angle_random_walk_deg_per_rt_hr=1", "gyro.angle_random_walk_rad_per_rt_s=1"},
       "give either this or angle_random_walk_rad_per_rt_s, not both"},
      {{"gyro.angle_random_walk_deg_per_rt_hr=1", "gyro.noise_density_deg_per_s_per_rt_hz=1"},
       "give either this or angle_random_walk_deg_per_rt_hr, not both"},
      {{"gyro.bias_instability_deg_per_hr=1", "gyro.bias_instability_from_s=0.01"},
       "too short for a sensor of 200 Hz"},
      {{"gyro.bias_instability_deg_per_hr=1", "gyro.bias_instability_to_s=1.5"}, "give an averaging time from 2 to"},
      {{"gyro.walk_transition=[1.1,1,1]"}, "its spectral radius is 1.1"},
      {{"gyro.angle_random_walk_deg_per_hr=1"}, "unknown key; did you mean \"angle_random_walk_deg_per_rt_hr\"?"},
  };
  for (const auto& [assignments, expected] : cases)
    EXPECT_NE(fault(assignments).find(expected), std::string::npos) << fault(assignments) << "\nfor: " << expected;
}

TEST_F(NoiseConfig, TermsAreToldInUnitsOfDataSheets) {
  const ImuModel m =
      model({"gyro.angle_random_walk_deg_per_rt_hr=0.15", "gyro.bias_instability_deg_per_hr=[0.5,0.5,1]",
             "gyro.rate_random_walk_deg_per_hr_per_rt_hr=0.02", "gyro.rate_ramp_deg_per_hr_per_hr=-3",
             "accelerometer.velocity_random_walk_m_per_s_per_rt_hr=0.06", "accelerometer.bias_instability_mg=0.05",
             "accelerometer.lsb_delta_velocity_m_per_s=0.003"});
  const std::vector<TriadTerms> terms = triad_terms(m);
  ASSERT_EQ(terms.size(), 2U);
  EXPECT_EQ(terms[0].text(),
            "random walk N 0.15 deg/sqrt(h), bias instability B [0.5, 0.5, 1] deg/h, "
            "bias random walk K 0.02 deg/h/sqrt(h), bias ramp R 3 deg/h/h, "
            "minimum [0.3373, 0.3373, 0.6669] deg/h");
  EXPECT_EQ(terms[1].text(),
            "random walk N 0.06 m/s/sqrt(h), bias instability B 0.05 mg, quantization noise Q 0.000866 m/s, minimum "
            "0.03321 mg");
  EXPECT_EQ(triad_terms(model({}))[0].text(), "");
  EXPECT_EQ(terms[0].bias_text(), "");
}

TEST_F(NoiseConfig, ConstantErrorsAreToldToo) {
  const std::vector<TriadTerms> terms =
      triad_terms(model({"gyro.turn_on_bias_deg_per_hr=[1,3,2]", "gyro.g_sensitivity_deg_per_hr_per_g=[7,-8,7]",
                         "accelerometer.turn_on_bias_mg=20"}));
  EXPECT_EQ(terms[0].bias_text(), "turn-on bias 3 deg/h, 8 deg/h/g by acceleration");
  EXPECT_EQ(terms[1].bias_text(), "turn-on bias 20 mg");
  const ImuModel drawn = model(
      {"gyro.unit_sigma={bias_deg_per_hr=[1,2,3],scale_factor_ppm=500,misalignment_mrad=1,cubic_ppm_of_range=5}",
       "gyro.turn_on_sigma={scale_factor_ppm=20,g_sensitivity_deg_per_hr_per_g=7,temperature_scale_ppm_per_c=1,cross_"
       "sensitivity_deg_per_hr_per_g2=1,"
       "vibration_rectification_deg_per_hr_per_g2=1}"});
  EXPECT_EQ(
      triad_terms(drawn)[0].bias_text(),
      "drawn for the unit: bias 3 deg/h, scale factor 500 ppm, nonlinearity, misalignment 1 mrad, drawn at power "
      "on: scale factor 20 ppm, sensitivity 7 deg/h/g, response to temperature, response to products of "
      "accelerations, response to vibration");
}

// White noise and random walks of the memo's keys are told, too: P per sample at 200 Hz.
TEST_F(NoiseConfig, TermsContainTheProcessPerSample) {
  const ImuModel white = model({"gyro.walk_transition=[0,0,0]", "gyro.walk_sqrt_cov=[1e-3,1e-3,1e-3]"});
  EXPECT_NEAR(allan_terms(white.gyro, 200)[0].N, 1e-3 / std::sqrt(200.0), 1e-15);
  const ImuModel walk = model({"gyro.walk_sqrt_cov=[1e-3,1e-3,1e-3]"});
  EXPECT_NEAR(allan_terms(walk.gyro, 200)[0].K, 1e-3 * std::sqrt(200.0), 1e-13);
  EXPECT_EQ(allan_terms(walk.gyro, 200)[0].N, 0);
  EXPECT_EQ(white.rate_hz, 200);
}

// Each axis is white noise, a walk or neither by its own row of A: (0, 0, 0.999) has white noise on two axes, and the
// bound of one axis leaves the walks of the others.
TEST_F(NoiseConfig, TermsOfTheProcessPerSampleAreOfEachAxis) {
  const ImuModel mixed = model({"gyro.walk_transition=[0,1,0.999]", "gyro.walk_sqrt_cov=[1e-3,2e-3,1e-5]"});
  const auto terms = allan_terms(mixed.gyro, 200);
  EXPECT_NEAR(terms[0].N, 1e-3 / std::sqrt(200.0), 1e-15);
  EXPECT_EQ(terms[0].K, 0);
  EXPECT_EQ(terms[1].N, 0);
  EXPECT_NEAR(terms[1].K, 2e-3 * std::sqrt(200.0), 1e-13);
  EXPECT_EQ(terms[2].N, 0);
  EXPECT_EQ(terms[2].K, 0);
  const ImuModel bounded = model({"gyro.walk_bound=[0,1,0]", "gyro.walk_sqrt_cov=[1e-3,1e-3,1e-3]"});
  EXPECT_NEAR(allan_terms(bounded.gyro, 200)[0].K, 1e-3 * std::sqrt(200.0), 1e-13);
  EXPECT_EQ(allan_terms(bounded.gyro, 200)[1].K, 0);
  const ImuModel coupled =
      model({"gyro.walk_transition=[[0,0.5,0],[0,0,0],[0,0,0]]", "gyro.walk_sqrt_cov=[1e-3,1e-3,1e-3]"});
  EXPECT_EQ(allan_terms(coupled.gyro, 200)[0].N, 0);
  EXPECT_NEAR(allan_terms(coupled.gyro, 200)[1].N, 1e-3 / std::sqrt(200.0), 1e-15);
}

// Standard deviations in the units of their keys, and what a reader of the file stumbles on.
TEST_F(NoiseConfig, StandardDeviationsAreOfTwoLayers) {
  const ImuModel m = model({"gyro.unit_sigma.bias_deg_per_hr=[1,2,3]", "gyro.unit_sigma.misalignment_mrad=[1,2,3]",
                            "gyro.unit_sigma.quadratic_ppm_of_range=100", "gyro.turn_on_sigma.scale_factor_ppm=50",
                            "accelerometer.unit_sigma.temperature_bias_mg_per_c=2", "mounting.alignment_sigma_mrad=4",
                            "gyro.unit_sigma.temperature_rate_bias_deg_per_hr_per_c_per_min=[1,2,3]",
                            "gyro.turn_on_sigma.temperature_hysteresis_deg_per_hr=4",
                            "gyro.unit_sigma.cross_sensitivity_deg_per_hr_per_g2=[5,6,7]",
                            "gyro.turn_on_sigma.vibration_rectification_deg_per_hr_per_g2=8",
                            "accelerometer.unit_sigma.cross_sensitivity_ug_per_g2=[1,2,3]",
                            "accelerometer.unit_sigma.vibration_rectification_ug_per_g2=[4,5,6]"});
  EXPECT_NEAR(m.gyro.unit_sigma.bias[2], 3 * 4.84813681109536e-6, 1e-18);
  Matrix3 misalignment;
  misalignment << 0, 1e-3, 1e-3, 2e-3, 0, 2e-3, 3e-3, 3e-3, 0;
  EXPECT_LT((m.gyro.unit_sigma.misalignment - misalignment).cwiseAbs().maxCoeff(), 1e-18);
  EXPECT_NEAR(m.gyro.unit_sigma.quadratic[0] * 100, 1e-3, 1e-15);  // at the range of 10 rad/s
  EXPECT_TRUE(m.gyro.unit_sigma.scale_factor.isZero(0.0));
  EXPECT_NEAR(m.gyro.turn_on_sigma.scale_factor[1], 5e-5, 1e-18);
  EXPECT_NEAR(m.accelerometer.unit_sigma.temperature_bias(0, 0), 0.0196133, 1e-12);
  EXPECT_NEAR(m.alignment_sigma[1], 4e-3, 1e-15);
  constexpr double deg_per_hr = 4.84813681109536e-6, g = 9.80665;
  EXPECT_NEAR(m.gyro.unit_sigma.temperature_rate_bias[2], 60 * 3 * deg_per_hr, 1e-15);
  EXPECT_NEAR(m.gyro.turn_on_sigma.temperature_hysteresis[0], 4 * deg_per_hr, 1e-18);
  EXPECT_NEAR(m.gyro.unit_sigma.cross_sensitivity(1, 2), 6 * deg_per_hr / g / g, 1e-18);
  EXPECT_NEAR(m.gyro.turn_on_sigma.vibration_rectification(2, 0), 8 * deg_per_hr / g / g, 1e-18);
  EXPECT_NEAR(m.accelerometer.unit_sigma.cross_sensitivity(2, 0), 3e-6 / g, 1e-18);
  EXPECT_NEAR(m.accelerometer.unit_sigma.vibration_rectification(1, 1), 5e-6 / g, 1e-18);
  EXPECT_EQ(m.accelerometer.unit_sigma.vibration_rectification(1, 0), 0);
  EXPECT_FALSE(model({}).gyro.unit_sigma.is_on());
  for (const auto& [key, expected] :
       {std::pair{"gyro.unit_sigma.scale_factor_ppm=-1", "gyro.unit_sigma.scale_factor_ppm: give three numbers"},
        {"gyro.turn_on_sigma.bias_deg_per_hr=1", "gyro.turn_on_sigma.bias_deg_per_hr: unknown key"},
        {"accelerometer.unit_sigma.g_sensitivity_deg_per_hr_per_g=1", "unknown key"},
        {"gyro.unit_sigma=1", "gyro.unit_sigma: "},
        {"mounting.alignment_sigma_mrad=101", "mounting.alignment_sigma_mrad: give three numbers"}})
    EXPECT_NE(fault({key}).find(expected), std::string::npos) << fault({key});
}

// Each term whose standard deviation is not 0, by the name under which summary and labels have it.
TEST_F(NoiseConfig, WhatIsDrawnHasItsName) {
  const ImuModel m =
      model({"gyro.unit_sigma={temperature_rate_bias_deg_per_hr_per_c_per_min=1,temperature_hysteresis_deg_per_hr=1}",
             "gyro.turn_on_sigma={cross_sensitivity_deg_per_hr_per_g2=1,vibration_rectification_deg_per_hr_per_g2=1}",
             "magnetometer.unit_sigma.bias_ut=1", "magnetometer.current_field_sigma_ut_per_a=[0,1,0]",
             "barometer.bias_sigma_pa=2", "barometer.port_error_sigma=3"});
  std::string names;
  for (const DrawnTerms& drawn : drawn_terms(m, 1, "imu1")) {
    names += fmt::format("{} {}:", drawn.sensor, drawn.layer);
    for (const auto& [name, values] : drawn.terms) names += fmt::format(" {} {}", name, values.size());
    names += "\n";
  }
  EXPECT_EQ(names,
            "gyro unit: temperature_rate_bias 3 temperature_hysteresis 3\n"
            "gyro turn_on: cross_sensitivity 9 vibration_rectification 9\n"
            "magnetometer unit: bias 3 current_field 3\nbarometer unit: bias 1 port 1\n");
}

// A drift leaves a product's white noise alone.
TEST_F(NoiseConfig, ATermIsAddedToThoseOfAProduct) {
  const std::vector<std::string> stim = {"protocol=\"stim300\"", "model=\"white\"", "rate_hz=2000",
                                         "gyro.max_rad_per_s=6.9"};
  std::vector<std::string> drifting = stim;
  drifting.push_back("gyro.rate_random_walk_deg_per_hr_per_rt_hr=0.1");
  EXPECT_EQ(model(drifting).gyro.walk_sqrt_cov, model(stim).gyro.walk_sqrt_cov);
  EXPECT_GT(model(stim).gyro.walk_sqrt_cov(0, 0), 0);
  EXPECT_GT(allan_terms(model(drifting).gyro, 2000)[0].N, 0);
  EXPECT_GT(allan_terms(model(drifting).gyro, 2000)[0].K, 0);
}

}  // namespace
}  // namespace imud
