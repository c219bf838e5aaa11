// Errors by the vehicle's states and by the sensor's history, from a configuration and a truth with columns to the
// rows that a host receives.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <functional>
#include <map>

#include "tests/emulator/run/run_test.hpp"

namespace imud {
namespace {

constexpr double deg_per_hr = 4.84813681109536e-6, g = 9.80665;

class SurroundingsRun : public RunTest {
 protected:
  using Row = std::map<std::string, double>;

  // Replays `seconds` of a vehicle at rest at 100 Hz, with these columns, to a sensor of 100 Hz without errors but
  // these. `motion` has other rates and specific forces.
  std::vector<Row> replay(const std::string& columns, const std::function<std::string(double)>& values,
                          const std::string& errors, double seconds = 1,
                          const std::function<std::string(double)>& motion = at_rest) {
    run(columns, values, "protocol = \"csv\"\n" + errors, seconds, motion);
    std::vector<Row> all;
    std::vector<std::string> names;
    for (const std::string& line : lines_of(read_file(path("rows")))) {
      std::vector<std::string> fields(1);
      for (const char letter : line)
        if (letter == ',')
          fields.emplace_back();
        else
          fields.back() += letter;
      if (names.empty()) {
        names = fields;
        continue;
      }
      Row& row = all.emplace_back();
      for (std::size_t i = 0; i < fields.size(); ++i)
        if (!fields[i].empty()) row[names.at(i)] = std::stod(fields[i]);
    }
    EXPECT_GT(all.size(), static_cast<std::size_t>(80 * seconds));
    return all;
  }
  // The same of the magnetic field, T, and the pressure, Pa, in frames.
  struct Fields {
    std::array<double, 3> magnetic_field;
    double pressure;
  };
  std::vector<Fields> replay_fields(const std::string& columns, const std::function<std::string(double)>& values,
                                    const std::string& errors) {
    const std::string frame = write("frame.toml",
                                    "frame_version = 1\nname = \"fields\"\n[[message]]\nlayout = [\"55 AA\", "
                                    "\"magnetic_field_x_t:f64\", \"magnetic_field_y_t:f64\", "
                                    "\"magnetic_field_z_t:f64\", \"pressure_pa:f64\"]\n");
    run(columns, values, fmt::format("protocol = \"frame\"\ndevice.frame_file = \"{}\"\n{}", frame, errors), 1,
        at_rest);
    const std::string bytes = read_file(path("rows"));
    constexpr std::size_t begin = 2, size = begin + sizeof(Fields);
    std::vector<Fields> all(bytes.size() / size);
    for (std::size_t i = 0; i < all.size(); ++i)
      std::memcpy(&all[i], bytes.data() + i * size + begin, sizeof(Fields));
    EXPECT_EQ(all.size(), 101U);
    return all;
  }

  void run(const std::string& columns, const std::function<std::string(double)>& values, const std::string& keys,
           double seconds, const std::function<std::string(double)>& motion) {
    std::string truth =
        "time_s,q_NB_w,q_NB_x,q_NB_y,q_NB_z,p_rad_per_s,q_rad_per_s,r_rad_per_s,specific_force_x_m_per_s2,"
        "specific_force_y_m_per_s2,specific_force_z_m_per_s2" +
        columns + "\n";
    for (int k = 0; k <= static_cast<int>(100 * seconds); ++k)
      truth += fmt::format("{},1,0,0,0{}{}\n", 0.01 * k, motion(0.01 * k), values(0.01 * k));
    const std::string c = write(
        "config.toml",
        fmt::format(
            "clock = \"fast\"\n[truth]\nport = \"udp:127.0.0.1:9810\"\nformat = \"csv\"\n[[imu]]\nrate_hz = 100\n"
            "port = \"file:{}\"\ngyro.max_rad_per_s = 100\naccelerometer.max_m_per_s2 = 1000\n{}",
            path("rows"), keys));
    const ProgramResult result = run_program("imud", {"replay", c, write("truth.csv", truth)});
    EXPECT_EQ(result.exit_code, 0) << result.errors;
  }
  static std::string at_rest(double) { return ",0,0,0,0,0,0"; }
  static std::string none(double) { return ""; }
};

TEST_F(SurroundingsRun, HarmonicsFollowARotorAndAThrottle) {
  const auto all = replay(
      ",rotor_speed_rpm,throttle", [](double) { return ",1200,0.5"; },
      "[imu.vibration]\nharmonic = [1]\nharmonic_g = [[0, 0, 2]]\nfollows = \"throttle\"\nfollows_at = [0, 1]\n"
      "follows_factor = [0, 4]\n");
  int compared = 0;
  for (const Row& row : all) {
    const double t = 1e-9 * row.at("time_ns");
    EXPECT_NEAR(row.at("accel_z"), 4 * 9.80665 * std::sin(2 * M_PI * 20 * t), 1e-5) << t;
    ++compared;
  }
  EXPECT_EQ(compared, 101);
}

// 10 deg/h for a degree a minute, in a chamber of 30 degrees a minute; hysteresis of 2 deg/h after 5 degrees.
TEST_F(SurroundingsRun, BiasFollowsTheCourseOfTheTemperature) {
  const auto all = replay("", none,
                          "gyro.temperature_rate_bias_deg_per_hr_per_c_per_min = 10\n"
                          "gyro.temperature_hysteresis_deg_per_hr = 2\ngyro.temperature_hysteresis_c = 5\n"
                          "[imu.temperature]\nprofile_s = [0, 20, 40]\nprofile_c = [20, 30, 20]\n",
                          40);
  const auto rate = [&](int s) { return all.at(static_cast<std::size_t>(100 * s)).at("gyro_x") / deg_per_hr; };
  EXPECT_NEAR(rate(5), 300 + 1, 1e-6);    // 2.5 degrees
  EXPECT_NEAR(rate(19), 300 + 2, 1e-6);   // on the curve of warming
  EXPECT_NEAR(rate(30), -300 + 0, 1e-6);  // 5 degrees back
  EXPECT_NEAR(rate(40), -300 - 2, 1e-6);
}

// A loss of power for 100 s of a sensor that warms up and cools down with 200 s.
TEST_F(SurroundingsRun, AWarmSensorStaysWarmWithoutPower) {
  const auto all = replay("", none,
                          "gyro.temperature_bias_rad_per_s_per_c = 1e-3\ngyro.reference_temperature_c = 25\n"
                          "[imu.temperature]\nwarm_up_c = 10\nwarm_up_s = 200\n"
                          "[[fault]]\nat_s = 400\nfor_s = 100\ntarget = \"power\"\nkind = \"off\"\n",
                          600);
  const double warm = 10 * (1 - std::exp(-2.0)), left = warm * std::exp(-0.5);
  std::map<int, double> bias;
  for (const Row& row : all) bias[static_cast<int>(std::lround(100 * 1e-9 * row.at("time_ns")))] = row.at("gyro_x");
  EXPECT_NEAR(bias.at(39'900), 1e-2 * (1 - std::exp(-399.0 / 200)), 1e-9);
  EXPECT_NEAR(bias.at(50'000), 1e-3 * left, 1e-6);
  EXPECT_NEAR(bias.at(60'000), 1e-3 * (10 - (10 - left) * std::exp(-0.5)), 1e-6);
}

TEST_F(SurroundingsRun, AFilterByTapsAndADelayActOnTheRows) {
  const auto all = replay("", none, "gyro.fir_taps = [0.5, 0.25, 0.25]\ngyro.bias_rad_per_s = 1\n");
  EXPECT_NEAR(all.at(50).at("gyro_x"), 1, 1e-12);
  // A ramp of the specific force's vibration: the sample is 35 ms old.
  const auto delayed =
      replay("", none, "sampling_delay_us = 35000\n[imu.vibration]\nsine_hz = [1]\nsine_g = [[1, 0, 0]]\n");
  int compared = 0;
  for (const Row& row : delayed) {
    const double t = 1e-9 * row.at("time_ns");
    EXPECT_NEAR(row.at("accel_x"), 9.80665 * std::sin(2 * M_PI * (t - 0.035)), 1e-6) << t;
    ++compared;
  }
  EXPECT_EQ(compared, 101);
}

TEST_F(SurroundingsRun, PopcornAndQuantizationActOnTheRows) {
  const auto all = replay("", none,
                          "gyro.popcorn_noise_rad_per_s = 0.5\ngyro.popcorn_time_s = 0.2\n"
                          "accelerometer.quantization_noise_m_per_s = 1e-3\n",
                          10);
  int jumps = 0;
  double sum = 0, largest = 0, last = 0;
  for (const Row& row : all) {
    const double rate = row.at("gyro_x");
    EXPECT_EQ(std::abs(rate), 0.5);
    jumps += last * rate < 0 ? 1 : 0;
    last = rate;
    sum += row.contains("dvel_x") ? row.at("dvel_x") : 0;
    largest = std::max(largest, std::abs(sum));
  }
  // 50 changes are expected, of which some lie within one sample: 5.5 sigma of 7.
  EXPECT_GT(jumps, 10);
  EXPECT_LT(jumps, 90);
  EXPECT_GT(largest, 1e-3);
  EXPECT_LT(largest, 1e-2) << "the readings do not add up";
}

// A rate that grows from -0.5 to 0.5 rad/s does not act below 0.1 rad/s.
TEST_F(SurroundingsRun, ADeadZoneActsOnTheRows) {
  const auto rate = [](double t) { return t - 0.5; };
  const auto all = replay("", none, "gyro.dead_zone_rad_per_s = [0, 0, 0.1]\n", 1,
                          [&](double t) { return fmt::format(",0,{0},{0},0,0,0", rate(t)); });
  for (const Row& row : all) {
    const double z = rate(1e-9 * row.at("time_ns"));
    EXPECT_NEAR(row.at("gyro_y"), z, 1e-9);
    EXPECT_NEAR(row.at("gyro_z"), z - std::clamp(z, -0.1, 0.1), 1e-9);
  }
}

// f = (1, 2, 3) g: its products are (6, 3, 2) g^2.
TEST_F(SurroundingsRun, ProductsOfAccelerationsActOnTheRows) {
  const auto all = replay("", none,
                          "gyro.cross_sensitivity_deg_per_hr_per_g2 = [[1, 10, 100], [0, 0, 0], [0, 2, 0]]\n"
                          "accelerometer.cross_sensitivity_ug_per_g2 = [100, 200, 300]\n",
                          1, [](double) { return fmt::format(",0,0,0,{},{},{}", g, 2 * g, 3 * g); });
  for (const Row& row : all) {
    EXPECT_NEAR(row.at("gyro_x") / deg_per_hr, 6 + 30 + 200, 1e-6);
    EXPECT_NEAR(row.at("gyro_y"), 0, 1e-15);
    EXPECT_NEAR(row.at("gyro_z") / deg_per_hr, 6, 1e-6);
    EXPECT_NEAR(row.at("accel_x") - g, 600e-6 * g, 1e-9);
    EXPECT_NEAR(row.at("accel_y") - 2 * g, 600e-6 * g, 1e-9);
    EXPECT_NEAR(row.at("accel_z") - 3 * g, 600e-6 * g, 1e-9);
  }
}

// A sine of 2 g along x, which is 0 at each sample, has a mean square of 2 g^2; its throttle makes it 0 to 8 g^2.
TEST_F(SurroundingsRun, VibrationRectifiedByGyrosActsOnTheRows) {
  const auto all = replay(
      ",throttle", [](double t) { return fmt::format(",{}", t); },
      "gyro.vibration_rectification_deg_per_hr_per_g2 = [[0, 0, 0], [5, 0, 0], [0, 7, 0]]\n"
      "[imu.vibration]\nsine_hz = [100]\nsine_g = [[2, 0, 0]]\nfollows = \"throttle\"\nfollows_at = [0, 1]\n"
      "follows_factor = [0, 2]\n");
  for (const Row& row : all) {
    const double factor = 2 * 1e-9 * row.at("time_ns");
    EXPECT_NEAR(row.at("gyro_x"), 0, 1e-15);
    EXPECT_NEAR(row.at("gyro_y") / deg_per_hr, factor * factor * 2 * 5, 1e-6);
    EXPECT_NEAR(row.at("gyro_z"), 0, 1e-15);
  }
}

// At its cut-off a filter of damping 0.5 has a gain of 2; a Butterworth filter has 1/sqrt(2).
TEST_F(SurroundingsRun, AFilterThatPeaksActsOnTheRows) {
  const auto amplitude = [&](const std::string& damping) {
    const auto all = replay(
        "", none,
        "gyro.low_pass_hz = 20\n" + damping + "[imu.vibration]\nsine_hz = [20]\nsine_deg_per_s = [[10, 0, 0]]\n", 2);
    double squares = 0;  // in the last twenty periods of five samples
    for (auto row = all.end() - 100; row != all.end(); ++row) squares += std::pow(row->at("gyro_x"), 2);
    return std::sqrt(squares / 50) / (10 * M_PI / 180);
  };
  EXPECT_NEAR(amplitude("gyro.low_pass_damping = 0.5\n"), 2, 1e-6);
  EXPECT_NEAR(amplitude(""), std::sqrt(0.5), 1e-6);
}

TEST_F(SurroundingsRun, ACurrentDisturbsTheMagnetometer) {
  const auto all = replay_fields(
      ",magnetic_field_x_ut,magnetic_field_y_ut,magnetic_field_z_ut,current_a",
      [](double t) { return fmt::format(",20,0,-40,{}", 50 * t); },
      "magnetometer.current_field_nt_per_a = [100, -200, 0]\n");
  for (std::size_t k = 0; k < all.size(); ++k) {
    const double current = 0.5 * static_cast<double>(k);
    EXPECT_NEAR(1e6 * all[k].magnetic_field[0], 20 + 0.1 * current, 1e-9) << k;
    EXPECT_NEAR(1e6 * all[k].magnetic_field[1], -0.2 * current, 1e-9) << k;
    EXPECT_NEAR(1e6 * all[k].magnetic_field[2], -40, 1e-9) << k;
  }
}

TEST_F(SurroundingsRun, TheDynamicPressureActsOnTheStaticPort) {
  const auto all = replay_fields(
      ",pressure_pa,dynamic_pressure_pa", [](double t) { return fmt::format(",90000,{}", 1000 * t); },
      "barometer.port_error = 0.03\n");
  for (std::size_t k = 0; k < all.size(); ++k)
    EXPECT_NEAR(all[k].pressure, 90000 + 0.3 * static_cast<double>(k), 1e-6) << k;
}

// A cause that determines a bias of each of two sensors alone, and half of the variance of another: all of them are
// in the rows as summary and labels have the cause.
TEST_F(SurroundingsRun, BiasesOfOneCauseAreOfOneDraw) {
  std::vector<double> drawn;
  for (int seed = 1; seed <= 5; ++seed) {
    const std::string c = write("config.toml", fmt::format("seed = {}\nclock = \"fast\"\n[truth]\n"
                                                           "port = \"udp:127.0.0.1:9810\"\nformat = \"csv\"\n"
                                                           "[[imu]]\nrate_hz = 100\nprotocol = \"csv\"\n"
                                                           "port = \"file:{}\"\ngyro.max_rad_per_s = 100\n"
                                                           "accelerometer.max_m_per_s2 = 1000\n"
                                                           "gyro.unit_sigma.bias_rad_per_s = [0.1, 0.2, 0.3]\n"
                                                           "accelerometer.unit_sigma.bias_m_per_s2 = 2\n"
                                                           "[[imu.cause]]\nname = \"stress\"\n"
                                                           "gyro.bias = [1, -1, 0.707106781186547]\n"
                                                           "accelerometer.bias = [0, 0, 1]\n",
                                                           seed, path("rows")));
    const std::string truth = write("truth.csv",
                                    "time_s,q_NB_w,q_NB_x,q_NB_y,q_NB_z,p_rad_per_s,q_rad_per_s,"
                                    "r_rad_per_s,specific_force_x_m_per_s2,specific_force_y_m_per_s2,"
                                    "specific_force_z_m_per_s2\n0,1,0,0,0,0,0,0,0,0,0\n"
                                    "1,1,0,0,0,0,0,0,0,0,0\n");
    const ProgramResult result =
        run_program("imud", {"replay", c, truth, "--summary", path("summary.json"), "--labels", path("labels.csv")});
    ASSERT_EQ(result.exit_code, 0) << result.errors;
    const nlohmann::json of_imu = summary().at("imus").at(0).at("drawn");
    const double stress = of_imu.at("cause").at("unit").at("stress").at(0);
    EXPECT_NE(read_file(path("labels.csv")).find(fmt::format("stress={}", stress)), std::string::npos);
    const auto fields = rows(read_file(path("rows"))).at(50);
    const auto value = [&](std::size_t column) { return std::stod(fields.at(column)); };
    EXPECT_NEAR(value(2), 0.1 * stress, 1e-15);
    EXPECT_NEAR(value(3), -0.2 * stress, 1e-15);
    EXPECT_NEAR(value(4), of_imu.at("gyro").at("unit").at("bias").at(2), 1e-15);
    EXPECT_GT(std::abs(value(4) - 0.3 * stress), 1e-3) << "with a part of its own";
    EXPECT_NEAR(value(7), 2 * stress, 1e-14);
    drawn.push_back(stress);
  }
  std::ranges::sort(drawn);
  EXPECT_EQ(std::ranges::adjacent_find(drawn), drawn.end());
}

}  // namespace
}  // namespace imud
