// Shared by the tests of the real-time loop: a motion whose samples tell the time, a configuration, a simulated run.
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "core/attitude.hpp"
#include "core/units.hpp"
#include "emulator/config/load_config.hpp"
#include "tests/emulator/run/run_test.hpp"
#include "tests/emulator/simulated.hpp"

namespace imud {

inline TruthTime at_s(double s) { return TruthTime{} + nanoseconds(s); }

// Swings about z, under a force in the inertial x-y plane whose direction and magnitude change. The force along z is
// constant, and is therefore extrapolated without error. The sum of a sensor's delta-velocities along z therefore
// gives the time up to which the sensor has sampled.
struct Swing {
  static constexpr double amplitude = 0.5, frequency = 2 * units::pi;  // rad, rad/s: up to 3.1 rad/s, 20 rad/s^2
  static constexpr double push = 4, push_frequency = 5, lift = 8;      // m/s^2, rad/s, m/s^2

  static double angle(double t) { return amplitude * std::sin(frequency * t); }
  static Vector3 dv_N(double t) {
    return {push / push_frequency * std::sin(push_frequency * t),
            push / (0.7 * push_frequency) * (1 - std::cos(0.7 * push_frequency * t)), lift * t};
  }
  static Truth truth(TruthTime time) {
    const double t = seconds(time - TruthTime{});
    Truth truth;
    truth.time = time;
    truth.sequence = static_cast<std::uint32_t>(time.ns / 10'000'000 + 1'000'000);
    truth.q_NB = Quaternion(Eigen::AngleAxisd(angle(t), Vector3::UnitZ()));
    truth.omega_BN_B = {0, 0, amplitude * frequency * std::cos(frequency * t)};
    truth.has_angular_acceleration = true;
    truth.omegaDot_BN_B = {0, 0, -frequency * frequency * angle(t)};
    truth.has_specific_force = true;
    truth.specific_force_B = truth.q_NB.conjugate() * Vector3(push * std::cos(push_frequency * t),
                                                              push * std::sin(0.7 * push_frequency * t), lift);
    truth.accumulated_dv = AccumulatedDv::inertial;
    truth.accumulated_dv_B = truth.q_NB.conjugate() * dv_N(t);
    return truth;
  }

  // The errors of extrapolation by h, bounded by the next derivatives.
  static double angle_error(double h) { return amplitude * std::pow(frequency * h, 3) / 6; }
  static double dv_error(double h) {
    return (push * push_frequency + amplitude * frequency * push * std::sqrt(2.0)) * h * h / 2;
  }
  // The error of interpolation between truths h apart by the cubic Hermite curve.
  static double angle_between(double h) { return amplitude * std::pow(frequency * h, 4) / 384; }
};

// The state of a navigator that adds up the increments, after each sample.
struct Reached {
  HostTime host;      // time at which the sample was sent
  double time_s = 0;  // of the truth, since its time 0, from the sum along z
  double angle = 0;   // about z
  Vector3 dv_N = Vector3::Zero();
  Sample sample;
};

class RealtimeTest : public RunTest {
 protected:
  // Returns a configuration with one imu at `rate_hz`, and more keys. The delay is 0 unless `truth` has another.
  Config config(double rate_hz, const std::string& truth, const std::string& imu = "", int imus = 1) const {
    std::string text = "clock = \"realtime\"\n[truth]\nport = \"udp:127.0.0.1:9810\"\n" + truth;
    if (truth.find("delay_ms") == std::string::npos) text += "\ndelay_ms = 0\n";
    for (int i = 0; i < imus; ++i)
      text += fmt::format(
          "\n[[imu]]\nname = \"i{0}\"\nport = \"file:{0}\"\nprotocol = \"native\"\nrate_hz = {1}\n"
          "gyro.max_rad_per_s = 100\naccelerometer.max_m_per_s2 = 1000\n"
          "increments.delta_velocity = \"end_frame\"\n{2}\n",
          i, rate_hz, imu);
    return load_config(write("config.toml", text));
  }

  // `first_s`: the truth time of the first sample.
  static std::vector<Reached> navigate(const std::vector<Left>& left, double first_s) {
    std::vector<Reached> all;
    Reached now;
    now.angle = Swing::angle(first_s);
    now.dv_N = Swing::dv_N(first_s);
    for (const Left& sample : left) {
      now.host = sample.time;
      now.sample = sample.sample;
      now.angle += sample.sample.delta_angle.z();
      now.dv_N += Eigen::AngleAxisd(now.angle, Vector3::UnitZ()) * sample.sample.delta_velocity;
      now.time_s = now.dv_N.z() / Swing::lift;
      all.push_back(now);
    }
    return all;
  }

  // Expects at least 4 samples without a gap and on the grid: counter k at start + k/rate, with the device's time.
  static void expect_grid(const std::vector<Left>& left, const Grid& grid, HostTime start, Nanoseconds late) {
    ASSERT_GE(left.size(), 4U);
    for (std::size_t k = 0; k < left.size(); ++k) {
      ASSERT_EQ(left[k].sample.counter, k);
      ASSERT_EQ(left[k].sample.time.ns - left[0].sample.time.ns,
                (grid.nominal_offset(k) - grid.nominal_offset(0)).count());
      const Nanoseconds lateness = left[k].time - (start + grid.offset(k));
      ASSERT_GE(lateness.count(), 0) << k;
      ASSERT_LE(lateness, late) << k;
    }
  }
};

}  // namespace imud
