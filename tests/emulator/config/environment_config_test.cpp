// The keys of limits, size effect, vibration, temperature and sampling jitter.
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <string>
#include <utility>
#include <vector>

#include "emulator/config/load_config.hpp"
#include "emulator/plan/config.hpp"
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
    std::ofstream(path) << config(assignments).resolved();
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

TEST_F(EnvironmentConfig, VibrationIsSinesAndASpectrum) {
  const std::vector<std::string> given = {"vibration.sine_hz=[50,120.5]",
                                          "vibration.sine_g=[[1,0,2],[0,0.5,0]]",
                                          "vibration.sine_deg_per_s=[[0,90,0],[0,0,0]]",
                                          "vibration.sine_phase_deg=[0,180]",
                                          "vibration.random_hz=[20,80,2000]",
                                          "vibration.random_g2_per_hz=[0.01,0.04,0.04]",
                                          "vibration.random_axes=[1,1,0.5]",
                                          "vibration.random_lines=100",
                                          "accelerometer.vibration_rectification_ug_per_g2=[30,0,-60]"};
  for (const ImuModel& m : {model(given), reloaded(given)}) {
    const VibrationModel& vibration = m.vibration;
    ASSERT_EQ(vibration.sines.size(), 2U);
    EXPECT_EQ(vibration.sines[1].frequency_hz, 120.5);
    EXPECT_LT((vibration.sines[0].force - Vector3(9.80665, 0, 19.6133)).norm(), 1e-13);
    EXPECT_NEAR(vibration.sines[0].rate.y(), 1.5707963267948966, 1e-15);
    EXPECT_NEAR(vibration.sines[1].phase, 3.141592653589793, 1e-15);
    EXPECT_EQ(vibration.spectrum.frequency_hz, std::vector<double>({20, 80, 2000}));
    EXPECT_NEAR(vibration.spectrum.force[1], 3.846815368900, 1e-12);  // 0.04 g^2/Hz
    EXPECT_TRUE(vibration.spectrum.rate.empty());
    EXPECT_EQ(vibration.spectrum.axes, Vector3(1, 1, 0.5));
    EXPECT_EQ(vibration.spectrum.lines, 100U);
    EXPECT_NEAR(m.accelerometer.vibration_rectification(2, 2), -60e-6 / 9.80665, 1e-18);
  }
  EXPECT_TRUE(model({}).vibration.sines.empty());
  EXPECT_TRUE(reloaded({}).vibration.spectrum.frequency_hz.empty());
}

TEST_F(EnvironmentConfig, VibrationHasHarmonicsAndFollowsTheTruth) {
  const std::vector<std::string> given = {"vibration.harmonic=[1,2.5]",
                                          "vibration.harmonic_g=[[1,0,0],[0,0,2]]",
                                          "vibration.harmonic_deg_per_s=[[0,90,0],[0,0,0]]",
                                          "vibration.harmonic_phase_deg=[0,90]",
                                          "vibration.follows=\"rotor_speed_rpm\"",
                                          "vibration.follows_at=[0,6000]",
                                          "vibration.follows_factor=[0,2]",
                                          "gyro.vibration_rectification_deg_per_hr_per_g2=[[0,1,0],[0,0,0],[0,0,3]]",
                                          "gyro.vibration_average_s=2"};
  for (const ImuModel& m : {model(given), reloaded(given)}) {
    ASSERT_EQ(m.vibration.harmonics.size(), 2U);
    EXPECT_EQ(m.vibration.harmonics[1].order, 2.5);
    EXPECT_NEAR(m.vibration.harmonics[1].force.z(), 19.6133, 1e-12);
    EXPECT_NEAR(m.vibration.harmonics[0].rate.y(), 1.5707963267948966, 1e-15);
    EXPECT_NEAR(m.vibration.harmonics[1].phase, 1.5707963267948966, 1e-15);
    EXPECT_EQ(m.vibration.envelope.of, VehicleState::rotor_speed);
    EXPECT_NEAR(m.vibration.envelope.at.at(1), 628.3185307179587, 1e-10);
    EXPECT_EQ(m.vibration.envelope.factor.at(1), 2);
    EXPECT_NEAR(m.gyro.vibration_rectification(2, 2) / (3 * 4.84813681109536e-6 / 9.80665 / 9.80665), 1, 1e-12);
    EXPECT_EQ(m.gyro.vibration_rectification(1, 1), 0);
    EXPECT_EQ(m.gyro.vibration_average, 2);
  }
  EXPECT_TRUE(model({}).vibration.envelope.at.empty());
  expect_faults({{{"vibration.harmonic=[1]"}, "vibration.harmonic: has no amplitudes"},
                 {{"vibration.harmonic=[0]", "vibration.harmonic_g=[[1,1,1]]"}, "vibration.harmonic: give a list"},
                 {{"vibration.follows=\"throttle\""}, "vibration.follows: has no curve"},
                 {{"vibration.follows=\"rpm\""}, "vibration.follows: "},
                 {{"vibration.follows_at=[1]", "vibration.follows_factor=[1]"}, "vibration.follows_at: belongs to"},
                 {{"vibration.follows=\"throttle\"", "vibration.follows_at=[1,0]", "vibration.follows_factor=[1,1]"},
                  "vibration.follows_at: give numbers in ascending order"},
                 {{"vibration.follows=\"throttle\"", "vibration.follows_at=[0,1]", "vibration.follows_factor=[1]"},
                  "vibration.follows_factor: has 1 elements"}});
}

TEST_F(EnvironmentConfig, ErrorsThatHardlyAnySensorHasHaveKeys) {
  constexpr double deg_per_hr = 4.84813681109536e-6, ug = 9.80665e-6, per_g2 = 1 / 9.80665 / 9.80665;
  const std::vector<std::string> given = {"gyro.dead_zone_deg_per_hr=[1,0,2]",
                                          "gyro.temperature_rate_bias_deg_per_hr_per_c_per_min=10",
                                          "accelerometer.temperature_hysteresis_ug=[5,0,0]",
                                          "accelerometer.temperature_hysteresis_c=8",
                                          "gyro.popcorn_noise_deg_per_hr=3",
                                          "gyro.popcorn_time_s=4",
                                          "gyro.quantization_noise_arcsec=0.5",
                                          "accelerometer.quantization_noise_um_per_s=7",
                                          "accelerometer.cross_sensitivity_ug_per_g2=[[0,1,0],[0,0,2],[3,0,0]]",
                                          "accelerometer.g_squared_sensitivity_ug_per_g2=[1,2,3]",
                                          "gyro.cross_sensitivity_deg_per_hr_per_g2=[1,2,3]",
                                          "gyro.fir_taps=[0.25,0.5,0.25]",
                                          "accelerometer.low_pass_hz=50",
                                          "accelerometer.low_pass_damping=0.7",
                                          "magnetometer.current_field_nt_per_a=[1,2,3]",
                                          "magnetometer.current_field_sigma_ut_per_a=[4,5,6]",
                                          "barometer.port_error_sigma=0.25",
                                          "sampling_delay_us=1500",
                                          "temperature.cool_down_s=900"};
  for (const ImuModel& m : {model(given), reloaded(given)}) {
    EXPECT_NEAR(m.gyro.dead_zone.z() / (2 * deg_per_hr), 1, 1e-12);
    EXPECT_NEAR(m.gyro.temperature_rate_bias.y() / (600 * deg_per_hr), 1, 1e-12);
    EXPECT_NEAR(m.accelerometer.temperature_hysteresis.x() / (5 * ug), 1, 1e-12);
    EXPECT_EQ(m.accelerometer.temperature_hysteresis_c, 8);
    EXPECT_NEAR(m.gyro.popcorn_noise.x() / (3 * deg_per_hr), 1, 1e-12);
    EXPECT_EQ(m.gyro.popcorn_time.x(), 4);
    EXPECT_NEAR(m.gyro.quantization_noise.x() / (0.5 * deg_per_hr), 1, 1e-12);
    EXPECT_NEAR(m.accelerometer.quantization_noise.x() / 7e-6, 1, 1e-12);
    EXPECT_NEAR(m.accelerometer.cross_sensitivity(1, 2) / (2e-6 / 9.80665), 1, 1e-12);
    EXPECT_NEAR(m.accelerometer.g_squared_sensitivity(2, 2) / (3e-6 / 9.80665), 1, 1e-12);
    EXPECT_NEAR(m.gyro.cross_sensitivity(1, 1) / (2 * deg_per_hr * per_g2), 1, 1e-12);
    ASSERT_NE(m.gyro.fir_taps, nullptr);
    EXPECT_EQ(*m.gyro.fir_taps, std::vector<double>({0.25, 0.5, 0.25}));
    EXPECT_EQ(m.accelerometer.filter.damping, 0.7);
    EXPECT_NEAR(m.current_field.z(), 3e-9, 1e-24);
    EXPECT_NEAR(m.current_field_sigma.y(), 5e-6, 1e-21);
    EXPECT_EQ(m.barometer.port_sigma, 0.25);
    EXPECT_EQ(m.sampling_delay.count(), 1'500'000);
    EXPECT_EQ(m.temperature.cool_down_s, 900);
  }
  expect_faults(
      {{{"gyro.popcorn_noise_deg_per_hr=1", "gyro.popcorn_time_s=0.001"}, "popcorn_time_s: give at least 0.005"},
       {{"gyro.fir_taps=[1,-1]"}, "gyro.fir_taps: give at most 1024 taps"},
       {{"gyro.low_pass_damping=0.01"}, "low_pass_damping: needs low_pass_order = 2; give 0.05 to 10"},
       {{"gyro.low_pass_damping=1", "gyro.low_pass_order=4"}, "low_pass_damping: needs low_pass_order = 2"},
       {{"magnetometer.quantization_noise_rad=1"}, "unknown key"},
       {{"sampling_delay_us=200000"}, "out of range"}});
}

// A sensor of its own in the place of the product's; keys beside it change it.
TEST_F(EnvironmentConfig, MagnetometerAndBarometerHaveModels) {
  const std::vector<std::string> given = {"magnetometer.model=\"rm3100\"", "magnetometer.bias_ut=[1,0,0]",
                                          "barometer.model=\"ms5611\"", "barometer.noise_pa=3"};
  for (const ImuModel& m : {model(given), reloaded(given)}) {
    EXPECT_NEAR(m.magnetometer.max, 800e-6, 1e-18);
    EXPECT_NEAR(m.magnetometer.white_density.x(), 1.2e-9, 1e-24);
    EXPECT_NEAR(m.magnetometer.bias.x(), 1e-6, 1e-20);
    EXPECT_NEAR(m.magnetometer.lsb, 13e-9, 1e-22);
    EXPECT_EQ(m.barometer.lsb, 1);
    EXPECT_EQ(m.barometer.noise, 3);
    EXPECT_EQ(m.barometer.least, 1000);
  }
  const ImuModel others = model({"magnetometer.model=\"bmm150\"", "barometer.model=\"dps310\""});
  EXPECT_LT((others.magnetometer.range().upper - Vector3(1300e-6, 1300e-6, 2500e-6)).norm(), 1e-15);
  // 0.3 uT RMS of samples of 50 ms.
  EXPECT_NEAR(others.magnetometer.white_density.x() * std::sqrt(20.0), 0.3e-6, 1e-9);
  EXPECT_NEAR(others.magnetometer.unit_sigma.bias.z(), 40e-6, 1e-15);
  EXPECT_NEAR(others.magnetometer.unit_sigma.scale_factor.x(), 0.02, 1e-12);
  EXPECT_EQ(others.barometer.noise, 0.5);
  EXPECT_EQ(others.barometer.least, 30000);
  EXPECT_EQ(others.barometer.largest, 120000);
  const ImuModel whole = model({"model=\"adis16448\"", "barometer.noise_pa=9"});
  EXPECT_NEAR(whole.magnetometer.max, 190e-6, 1e-18);
  EXPECT_EQ(whole.barometer.lsb, 2);
  EXPECT_EQ(whole.barometer.noise, 9);
  expect_faults(
      {{{"magnetometer.model=\"rm3000\""}, "magnetometer.model: there is no such sensor \"rm3000\"; did you mean"},
       {{"magnetometer.model=\"bmp390\""}, "magnetometer.model: there is no such sensor"},
       {{"model=\"bmp390\""}, "model: bmp390 has no gyros"},
       {{"barometer.min_pa=9", "barometer.max_pa=8"}, "barometer.max_pa: give a pressure above min_pa"}});
}

// Products whose messages have no time have no stamp that could be off.
TEST_F(EnvironmentConfig, StampsThatNobodySendsAreAWarning) {
  const auto warnings = [&](const std::string& protocol, const std::string& port, std::vector<std::string> keys) {
    const std::string path = folder_ / "stamps.toml";
    std::ofstream(path) << "[truth]\nport = \"udp:127.0.0.1:9810\"\n[[imu]]\nprotocol = \"" << protocol
                        << "\"\nport = \"" << port << "\"\n";
    for (std::string& key : keys) key.insert(0, "imu.0.");
    return load_config(path, keys).warnings;
  };
  const std::vector<std::string> of_stim300 = warnings("stim300", "pty:imu1", {"stamp_offset_us=-50"});
  ASSERT_EQ(of_stim300.size(), 1U);
  EXPECT_NE(of_stim300[0].find("imu.0.stamp_offset_us: has no effect: stim300 sends no time with these settings; "
                               "sampling_delay_us makes its samples late"),
            std::string::npos)
      << of_stim300[0];
  const std::vector<std::string> of_j1939 =
      warnings("j1939", "can:vcan0", {"stamp_offset_us=5", "stamp_jitter_us=5"});
  ASSERT_EQ(of_j1939.size(), 2U);
  EXPECT_NE(of_j1939[1].find("imu.0.stamp_jitter_us: has no effect: j1939"), std::string::npos) << of_j1939[1];
  EXPECT_EQ(warnings("stim300", "pty:imu1", {}).size(), 0U);
  // A field with time; one that a host selects; and the time of the bus, which is not known yet.
  EXPECT_EQ(warnings("native", "pty:imu1",
                     {"stamp_offset_us=5", "rate_hz=100", "gyro.max_rad_per_s=9", "accelerometer.max_m_per_s2=9"})
                .size(),
            0U);
  const std::string binary = "device.binary_1=\"1,8,01,0101\"";
  EXPECT_EQ(warnings("vectornav", "pty:imu1", {"stamp_offset_us=5", binary}).size(), 0U);
  EXPECT_EQ(warnings("vectornav", "pty:imu1", {"stamp_offset_us=5"}).size(), 1U);
  EXPECT_EQ(warnings("dronecan", "can:vcan0", {"stamp_offset_us=5"}).size(), 0U);
}

TEST_F(EnvironmentConfig, ImpossibleVibrationsAreFaults) {
  expect_faults({
      {{"vibration.sine_hz=[0]"}, "imu.0.vibration.sine_hz: give a list of numbers from 0.001"},
      {{"vibration.sine_hz=5"}, "imu.0.vibration.sine_hz: give a list"},
      {{"vibration.sine_hz=[5]"}, "imu.0.vibration.sine_hz: has no amplitudes"},
      {{"vibration.sine_hz=[5]", "vibration.sine_g=[1,2,3]"}, "imu.0.vibration.sine_g: give a list of rows"},
      {{"vibration.sine_hz=[5]", "vibration.sine_g=[[1,2,3],[1,2,3]]"}, "imu.0.vibration.sine_g: has 2 elements"},
      {{"vibration.sine_hz=[5,6]", "vibration.sine_g=[[1,2,3],[1,2,3]]", "vibration.sine_phase_deg=[1]"},
       "imu.0.vibration.sine_phase_deg: has 1 elements"},
      {{"vibration.random_hz=[20,10]", "vibration.random_g2_per_hz=[1,1]"},
       "imu.0.vibration.random_hz: give at least"},
      {{"vibration.random_hz=[20]", "vibration.random_g2_per_hz=[1]"}, "imu.0.vibration.random_hz: give at least"},
      {{"vibration.random_hz=[10,20]"}, "imu.0.vibration.random_hz: has no densities"},
      {{"vibration.random_hz=[10,20]", "vibration.random_g2_per_hz=[1,0]"},
       "imu.0.vibration.random_g2_per_hz: give a"},
      {{"vibration.random_g2_per_hz=[1,1]"}, "imu.0.vibration.random_g2_per_hz: has 2 elements"},
  });
}

TEST_F(EnvironmentConfig, TemperatureIsAProfileWithWarmUpAndItsMeasurement) {
  const std::vector<std::string> given = {"temperature.profile_s=[0,600]", "temperature.profile_c=[-40,85]",
                                          "temperature.warm_up_c=12",      "temperature.warm_up_s=300",
                                          "temperature.offset_c=-2",       "temperature.lsb_c=0.125",
                                          "temperature.rate_hz=10"};
  for (const ImuModel& m : {model(given), reloaded(given)}) {
    EXPECT_EQ(m.temperature.profile_s, std::vector<double>({0, 600}));
    EXPECT_EQ(m.temperature.profile_c, std::vector<double>({-40, 85}));
    EXPECT_EQ(m.temperature.warm_up_c, 12);
    EXPECT_EQ(m.temperature.warm_up_s, 300);
    EXPECT_EQ(m.temperature.offset_c, -2);
    EXPECT_EQ(m.temperature.lsb_c, 0.125);
    EXPECT_EQ(m.temperature.rate_hz, 10);
  }
  expect_faults(
      {{{"temperature.profile_s=[1,1]", "temperature.profile_c=[1,2]"}, "temperature.profile_s: give times"},
       {{"temperature.profile_s=[1,2]"}, "temperature.profile_s: has no temperatures"},
       {{"temperature.profile_s=[1,2]", "temperature.profile_c=[1]"}, "temperature.profile_c: has 1 elements"},
       {{"temperature.profile_c=[1]"}, "temperature.profile_c: has 1 elements"},
       {{"temperature.warm_up_s=0"}, "temperature.warm_up_s: 0 is out of range"},
       {{"temperature.lsb_c=-1"}, "temperature.lsb_c: -1 is out of range"}});
}

// 1 deg/h = 4.84813681109536e-6 rad/s.
TEST_F(EnvironmentConfig, PolynomialsOfTemperatureHaveAKeyForEachDegree) {
  const std::vector<std::string> given = {
      "gyro.temperature_bias_deg_per_hr_per_c=[1,2,3]", "gyro.temperature_bias_deg_per_s_per_c2=0.001",
      "accelerometer.temperature_bias_ug_per_c3=5", "accelerometer.temperature_scale_ppm_per_c=[10,20,30]",
      "accelerometer.reference_temperature_c=30"};
  for (const ImuModel& m : {model(given), reloaded(given)}) {
    EXPECT_NEAR(m.gyro.temperature_bias(1, 0) / (2 * 4.84813681109536e-6), 1, 1e-13);
    EXPECT_NEAR(m.gyro.temperature_bias(2, 1) / (0.001 * 0.0174532925199433), 1, 1e-13);
    EXPECT_EQ(m.gyro.temperature_bias(0, 2), 0);
    EXPECT_NEAR(m.accelerometer.temperature_bias(0, 2) / (5 * 9.80665e-6), 1, 1e-13);
    EXPECT_NEAR(m.accelerometer.temperature_scale(2, 0), 30e-6, 1e-19);
    EXPECT_EQ(m.accelerometer.reference_temperature_c, 30);
    EXPECT_EQ(m.gyro.reference_temperature_c, 25);
  }
  expect_faults({{{"gyro.temperature_bias_deg_per_hr_per_c=1", "gyro.temperature_bias_rad_per_s_per_c=1"},
                  "give either this or temperature_bias_rad_per_s_per_c, not both"},
                 {{"gyro.temperature_bias_deg_per_hr_per_c=[1]"},
                  "gyro.temperature_bias_deg_per_hr_per_c: give three numbers"}});
}

TEST_F(EnvironmentConfig, SamplingJitterIsBelowThePeriod) {
  EXPECT_EQ(model({}).sampling_jitter.count(), 0);
  EXPECT_EQ(model({"sampling_jitter_us=20"}).sampling_jitter.count(), 20'000);
  EXPECT_EQ(model({"sampling_jitter_us=4500"}).sampling_jitter.count(), 4'500'000);
  expect_faults({{{"sampling_jitter_us=4501"}, "imu.0.sampling_jitter_us: give at most 4500"},
                 {{"sampling_jitter_us=-1"}, "imu.0.sampling_jitter_us: -1 is out of range"}});
}

TEST_F(EnvironmentConfig, ClockHasAWanderAndStampsHaveErrors) {
  const std::vector<std::string> given = {"stamp_offset_us=-30",
                                          "stamp_jitter_us=5",
                                          "clock.phase_random_walk_ns_per_rt_s=4",
                                          "clock.frequency_random_walk_ppm_per_rt_hr=0.6",
                                          "clock.temperature_ppm_per_c=0.2",
                                          "clock.temperature_ppm_per_c2=-0.035",
                                          "clock.reference_temperature_c=28"};
  for (const ImuModel& m : {model(given), reloaded(given)}) {
    EXPECT_NEAR(m.stamp_error.offset_s, -30e-6, 1e-18);
    EXPECT_NEAR(m.stamp_error.jitter_s, 5e-6, 1e-18);
    EXPECT_NEAR(m.oscillator.phase_random_walk, 4e-9, 1e-21);
    EXPECT_NEAR(m.oscillator.frequency_random_walk, 1e-8, 1e-20);
    EXPECT_NEAR(m.oscillator.temperature_linear, 0.2e-6, 1e-18);
    EXPECT_NEAR(m.oscillator.temperature_quadratic, -0.035e-6, 1e-18);
    EXPECT_EQ(m.oscillator.reference_c, 28);
  }
  expect_faults(
      {{{"stamp_jitter_us=251"}, "imu.0.stamp_jitter_us: give at most 250, a twentieth of the sample period"},
       {{"stamp_offset_us=2e6"}, "imu.0.stamp_offset_us: 2000000 is out of range"},
       {{"clock.wander=1"}, "imu.0.clock.wander: unknown key"},
       {{"clock.frequency_random_walk_ppm_per_rt_hr=-1"}, "-1 is out of range"}});
  // The same instants without the errors of the sensors, and true stamps.
  const ImuConfig truth = without_errors(config(given).imus.at(0));
  EXPECT_EQ(truth.model.oscillator.reference_c, 28);
  EXPECT_EQ(truth.model.stamp_error.offset_s, 0);
  EXPECT_EQ(truth.model.stamp_error.jitter_s, 0);
}

}  // namespace
}  // namespace imud
