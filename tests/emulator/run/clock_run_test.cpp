// The errors of a sensor's clock from a configuration to the rows that a host receives: the instants, which a turning
// vehicle shows, and the stamps.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstring>
#include <functional>
#include <map>

#include "emulator/record/measurement_rows.hpp"
#include "emulator/record/row_truths.hpp"
#include "tests/core/allan.hpp"
#include "tests/emulator/run/run_test.hpp"

namespace imud {
namespace {

constexpr double acceleration = 0.01;  // rad/s^2, of the vehicle

class ClockRun : public RunTest {
 protected:
  struct Row {
    double stamp_s, true_s;  // of the instant, by the rate
  };

  // A truth at 10 Hz for `seconds`, with a temperature.
  void write_truth(
      int seconds, const std::function<double(double)>& celsius = [](double) { return 25.0; }) const {
    std::string truth =
        "time_s,q_NB_w,q_NB_x,q_NB_y,q_NB_z,p_rad_per_s,q_rad_per_s,r_rad_per_s,specific_force_x_m_per_s2,"
        "specific_force_y_m_per_s2,specific_force_z_m_per_s2,temperature_c\n";
    for (int k = 0; k <= 10 * seconds; ++k) {
      const double t = 0.1 * k, half = 0.25 * acceleration * t * t;
      truth += fmt::format("{:.1f},{},{},0,0,{},0,0,0,0,0,{}\n", t, std::cos(half), std::sin(half), acceleration * t,
                           celsius(t));
    }
    write("truth.csv", truth);
  }
  // Replays it to a sensor of 10 Hz without errors but these.
  std::vector<Row> replay(const std::string& errors, int seconds) const {
    const std::string c = write(
        "config.toml",
        fmt::format(
            "clock = \"fast\"\n[truth]\nport = \"udp:127.0.0.1:9810\"\nformat = \"csv\"\n[[imu]]\nrate_hz = 10\n"
            "protocol = \"csv\"\nport = \"file:{}\"\ngyro.max_rad_per_s = 1000\n"
            "accelerometer.max_m_per_s2 = 1000\n{}",
            path("rows"), errors));
    const ProgramResult result = run_program("imud", {"replay", c, path("truth.csv")});
    EXPECT_EQ(result.exit_code, 0) << result.errors;
    std::vector<Row> all;
    for (const auto& row : rows(read_file(path("rows"))))
      all.push_back({1e-9 * static_cast<double>(std::stoll(row[0])), std::stod(row[2]) / acceleration});
    EXPECT_GT(static_cast<int>(all.size()), 10 * seconds - 20);
    return all;
  }
};

TEST_F(ClockRun, FrequencyWalksAtRandom) {
  write_truth(3000);
  const auto all = replay("clock.frequency_random_walk_ppm_per_rt_hr = 120\n", 3000);
  const double K = 120e-6 / 60;
  std::vector<double> steps;
  for (std::size_t k = 1; k < all.size(); ++k) {
    ASSERT_NEAR(all[k].stamp_s, 0.1 * static_cast<double>(k), 1e-9) << "stamps are the clock's own";
    steps.push_back(0.1 - (all[k].true_s - all[k - 1].true_s));
  }
  for (const std::size_t m : {1U, 8U, 64U, 512U}) {
    AllanVariance variance;
    variance.add(steps, m, 0.1);
    const double tau = 0.1 * static_cast<double>(m), expected = K * K * tau / 3;
    EXPECT_TRUE(variance.fits(expected, 1e-7)) << tau << " s: " << variance.value() / expected;
  }
}

TEST_F(ClockRun, PhaseWalksAtRandom) {
  write_truth(1000);
  const auto all = replay("clock.phase_random_walk_ns_per_rt_s = 2000\nclock_error_ppm = 1000\n", 1000);
  std::vector<double> steps;
  for (std::size_t k = 1; k < all.size(); ++k) steps.push_back(0.1 / 1.001 - (all[k].true_s - all[k - 1].true_s));
  for (const std::size_t m : {1U, 8U, 64U}) {
    AllanVariance variance;
    variance.add(steps, m, 0.1);
    const double tau = 0.1 * static_cast<double>(m), expected = 4e-12 / tau;
    EXPECT_TRUE(variance.fits(expected, 1e-7)) << tau << " s: " << variance.value() / expected;
  }
}

// A crystal of -0.04 ppm/K^2 that turns at 25 degrees, in a chamber and in the truth's temperature.
TEST_F(ClockRun, FrequencyIsAParabolaOfTheTemperature) {
  const std::string crystal = "clock.temperature_ppm_per_c2 = -0.04\nclock.reference_temperature_c = 25\n";
  const auto chamber = [](double t) { return -40 + 0.4 * t; };
  write_truth(300, chamber);
  for (const std::string temperature :
       {"temperature.profile_s = [0, 300]\ntemperature.profile_c = [-40, 80]\n", "temperature.from_truth = true\n"}) {
    const auto all = replay(crystal + temperature, 300);
    for (std::size_t k = 50; k + 50 < all.size(); k += 50) {
      const double fast = 10 / (all[k + 50].true_s - all[k - 50].true_s) - 1, x = chamber(all[k].true_s) - 25;
      // The mean of the parabola over 10 s, in which the temperature changes by 4 degrees.
      EXPECT_NEAR(1e6 * fast, -0.04 * (x * x + 4.0 * 4 / 12), 0.005 + 0.002 * std::abs(x)) << temperature << x;
    }
  }
}

TEST_F(ClockRun, StampsAreOffWithoutTheSamples) {
  write_truth(1000);
  const auto plain = replay("", 1000), off = replay("stamp_offset_us = 300\nstamp_jitter_us = 40\n", 1000);
  ASSERT_EQ(off.size(), plain.size());
  double sum = 0, square = 0;
  for (std::size_t k = 0; k < off.size(); ++k) {
    ASSERT_EQ(off[k].true_s, plain[k].true_s) << k;
    const double n = (off[k].stamp_s - plain[k].stamp_s - 300e-6) / 40e-6;
    sum += n;
    square += n * n;
  }
  const auto count = static_cast<double>(off.size());
  EXPECT_NEAR(sum / count, 0, 5 / std::sqrt(count));
  EXPECT_NEAR(square / count, 1, 5 * std::sqrt(2 / count));
  // A clock counts from 0.
  const auto early = replay("stamp_offset_us = -150000\n", 1000);
  EXPECT_EQ(early[0].stamp_s, 0);
  EXPECT_EQ(early[1].stamp_s, 0);
  EXPECT_NEAR(early[2].stamp_s, 0.05, 1e-9);
}

// The instants of a seed are its own, and so is the truth beside its measurements, with and without faults.
TEST_F(ClockRun, ArraysOfSeedsHaveTheTruthOfEachSeed) {
  write_truth(100);
  const std::string keys = fmt::format(
      "clock = \"fast\"\n[truth]\nport = \"udp:127.0.0.1:9810\"\nformat = \"csv\"\n[[imu]]\nrate_hz = 100\n"
      "protocol = \"native\"\nport = \"file:{}\"\ngyro.max_rad_per_s = 1000\n"
      "accelerometer.max_m_per_s2 = 1000\nstamp_jitter_us = 5\nstamp_offset_us = 77\n"
      "clock.frequency_random_walk_ppm_per_rt_hr = 10000\nclock.phase_random_walk_ns_per_rt_s = 50000\n",
      path("out"));
  using Truths = std::array<std::map<std::int64_t, TrueRow>, 3>;  // by seed and by the time of the measurement
  const auto truths_with = [&](const std::string& faults) {
    const ProgramResult result = run_program("imud", {"replay", write("config.toml", keys + faults),
                                                      path("truth.csv"), "--seeds", "1..3", "--npy", path("a.npy")});
    EXPECT_EQ(result.exit_code, 0) << result.errors;
    const auto data_of = [&](const std::string& name) {
      const std::string all = read_file(path(name));
      return all.substr(10 + static_cast<unsigned char>(all.at(8)) + 256U * static_cast<unsigned char>(all.at(9)));
    };
    const std::string measured = data_of("a.npy"), truth = data_of("a_truth.npy");
    const std::size_t size = row_size(false), rows = measured.size() / size;
    EXPECT_EQ(rows, truth.size() / sizeof(TrueRow));
    EXPECT_EQ(rows % 3, 0U);
    Truths truths;
    for (std::size_t i = 0; i < rows; ++i) {
      MeasurementRow row{Measurement{}};
      TrueRow known;
      std::memcpy(static_cast<void*>(&row), measured.data() + i * size, size);
      std::memcpy(&known, truth.data() + i * sizeof known, sizeof known);
      if (row.time_ns == MeasurementRow::no_time) continue;
      EXPECT_EQ(row.gyro[0], known.values.gyro[0]) << i;
      truths[i / (rows / 3)].emplace(row.time_ns, known);
    }
    return truths;
  };
  const Truths whole = truths_with("");
  for (const auto& truth : whole) EXPECT_NEAR(static_cast<double>(truth.size()), 10'001, 50);
  EXPECT_NE(whole[0].rbegin()->second.values.gyro[0], whole[1].rbegin()->second.values.gyro[0]);
  EXPECT_NE(whole[1].rbegin()->second.values.gyro[0], whole[2].rbegin()->second.values.gyro[0]);

  const Truths lossy =
      truths_with("[[fault]]\ntarget = \"message\"\nkind = \"missing\"\nat_s = 2\nfor_s = 20\neach = 0.5\n");
  for (std::size_t seed = 0; seed < lossy.size(); ++seed) {
    EXPECT_NEAR(static_cast<double>(lossy[seed].size()), 9'000, 200);
    for (const auto& [time, known] : lossy[seed]) {
      ASSERT_TRUE(whole[seed].contains(time)) << time;
      const TrueValues &values = whole[seed].at(time).values, &same = known.values;
      ASSERT_EQ(same.gyro[0], values.gyro[0]) << time;
      if (std::isnan(values.dtheta[0])) continue;
      ASSERT_NEAR(same.dtheta[0], values.dtheta[0], 1e-15) << time;
    }
  }
}

// Wander and stamp errors have numbers of their own: noise stays as it is.
TEST_F(ClockRun, OtherRandomNumbersStay) {
  write_truth(10);
  const std::string noise = "accelerometer.velocity_random_walk_m_per_s_per_rt_hr = 0.1\n";
  replay(noise, 10);
  const auto plain = rows(read_file(path("rows")));
  replay(noise + "stamp_jitter_us = 40\nclock.frequency_random_walk_ppm_per_rt_hr = 10\n", 10);
  const auto off = rows(read_file(path("rows")));
  ASSERT_GE(plain.size(), off.size());
  for (std::size_t k = 0; k < off.size(); ++k)
    for (std::size_t axis = 5; axis < 8; ++axis) ASSERT_EQ(off[k][axis], plain[k][axis]) << k;
}

}  // namespace
}  // namespace imud
