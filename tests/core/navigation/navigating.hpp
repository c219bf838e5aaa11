// Flights of a unit with its own filter, for the tests of the Navigator.
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "core/attitude.hpp"
#include "core/earth/earth.hpp"
#include "core/imu.hpp"
#include "core/navigation/navigator.hpp"
#include "core/timeline.hpp"
#include "core/units.hpp"
#include "tests/support/allocations.hpp"

namespace imud {

// A coordinated turn in a local level: 20 m/s on a circle of 200 m, in a bank that keeps the specific force along z,
// 100 m above the origin at 45 degrees north.
inline Truth turn_at(TruthTime time) {
  constexpr double speed = 20, radius = 200, w = speed / radius, g = units::standard_gravity;
  const double t = seconds(time - TruthTime{}), yaw = w * t;
  const double bank = std::atan(speed * w / g);
  Truth truth;
  truth.time = time;
  truth.q_NB = Eigen::AngleAxisd(yaw, Vector3::UnitZ()) * Eigen::AngleAxisd(bank, Vector3::UnitX());
  truth.omega_BN_B = truth.q_NB.conjugate() * Vector3(0, 0, w);
  truth.has_position = truth.has_velocity = truth.has_specific_force = true;
  truth.r_BN_N = {radius * std::sin(yaw), -radius * std::cos(yaw), -100};
  truth.v_BN_N = {speed * std::cos(yaw), speed * std::sin(yaw), 0};
  const Vector3 a_N = speed * w * Vector3(-std::sin(yaw), std::cos(yaw), 0);
  truth.specific_force_B = truth.q_NB.conjugate() * Vector3(a_N - Vector3(0, 0, g));
  return truth;
}

// The sensors of a unit, and its filter.
struct NavigatingUnit : ImuModel {
  NavigatorModel navigator;
};

inline NavigatingUnit ideal_unit() {
  NavigatingUnit model;
  model.rate_hz = 50;
  model.earth.frame = EarthModel::Frame::local;
  model.earth.latitude = 45 * units::degree;
  return model;
}

// White noise and turn-on biases of a good MEMS sensor; a receiver with errors.
inline NavigatingUnit mems_unit() {
  NavigatingUnit model = ideal_unit();
  model.gyro.white_density = Vector3::Constant(1e-4);
  model.gyro.turn_on_bias = Vector3::Constant(1e-3);
  model.accelerometer.white_density = Vector3::Constant(1e-3);
  model.accelerometer.turn_on_bias = Vector3::Constant(0.02);
  model.magnetometer.white_density = Vector3::Constant(2e-8);
  model.navigation.position_noise = model.navigator.position = {1, 1, 2};
  model.navigation.velocity_noise = model.navigator.velocity = {0.05, 0.05, 0.1};
  tune(model.navigator, model);
  return model;
}

// The errors of a solution (rad about north, east, down; m/s; m), and the reported standard deviations of the same.
struct Errors {
  Vector3 attitude, velocity, position;
};

inline Nanoseconds in_time(Nanoseconds time) { return time; }

// Flies the unit through turns. Calls `look` with each sample and its solution, the errors of the solution, and the
// time, s. `disturb` changes each sample before the navigator gets it. `simulated`: returns the simulator's time at a
// time of the unit. `motion`: of the vehicle. `at_end` is called with the navigator after the last sample.
inline void fly(const NavigatingUnit& model, double seconds_long, const std::function<void(Sample&, double)>& disturb,
                const std::function<void(const Sample&, const Errors&, double)>& look, std::uint64_t seed = 1,
                Nanoseconds (*simulated)(Nanoseconds) = in_time, Truth (*motion)(TruthTime) = turn_at,
                const std::function<void(const Navigator&)>& at_end = nullptr) {
  Timeline timeline;
  ImuModel without = model;
  without.navigation = {};
  without.magnetometer = {};
  Imu imu(model, seed, 1), reference(without, seed, 1);
  Navigator navigator(model.navigator, model);
  const Grid grid(model.rate_hz), truths(100);
  std::uint64_t pushed = 0;
  for (std::uint64_t k = 0; grid.offset(k) <= nanoseconds(seconds_long); ++k) {
    const TruthTime time = TruthTime{} + simulated(grid.offset(k));
    for (; truths.offset(pushed) <= simulated(grid.offset(k)); ++pushed)
      ASSERT_NE(timeline.push(motion(TruthTime{} + truths.offset(pushed))), Admission::duplicate);
    Sample sample = imu.sample(timeline, time, DeviceTime{grid.offset(k).count()});
    const Sample truth = reference.sample(timeline, time, sample.time);
    const double t = seconds(grid.offset(k));
    if (disturb) disturb(sample, t);
    const std::uint64_t allocated = allocations();
    navigator.take(sample, time, std::nullopt);
    EXPECT_EQ(allocations(), allocated);
    Errors errors;
    errors.attitude = log(sample.q_LP * truth.q_LP.conjugate());
    errors.velocity = sample.navigation.v_L - truth.navigation.v_L;
    errors.position = dcm_EL(truth.navigation.latitude, truth.navigation.longitude).transpose() *
                      (sample.navigation.r_E - truth.navigation.r_E);
    look(sample, errors, t);
  }
  if (at_end) at_end(navigator);
}

inline void lose_fix(Sample& sample) { sample.navigation = {}; }

// The mean square of errors in units of the reported variance, over eight units: near 1.
struct MeanSquares {
  double tilt = 0, heading = 0, velocity = 0, position = 0, height = 0;
};
inline MeanSquares mean_squares(const NavigatingUnit& model, double from_s, double to_s) {
  MeanSquares mean;
  int count = 0;
  const auto square = [](const Vector3& error, const Eigen::Vector3f& sigma, int axis) {
    const double ratio = error[axis] / static_cast<double>(sigma[axis]);
    return ratio * ratio;
  };
  for (std::uint64_t seed = 1; seed <= 8; ++seed)
    fly(
        model, to_s, nullptr,
        [&](const Sample& sample, const Errors& errors, double t) {
          if (t < from_s || sample.solution->state == Solution::State::aligning) return;
          ++count;
          mean.tilt += square(errors.attitude, sample.solution->attitude, 0);
          mean.heading += square(errors.attitude, sample.solution->attitude, 2);
          mean.velocity += square(errors.velocity, sample.solution->velocity, 0);
          mean.position += square(errors.position, sample.solution->position, 0);
          mean.height += square(errors.position, sample.solution->position, 2);
        },
        seed);
  return {mean.tilt / count, mean.heading / count, mean.velocity / count, mean.position / count, mean.height / count};
}

}  // namespace imud
