// Accelerometers that are not at one point, against closed forms: a centrifuge, a turntable that speeds up, and the
// same sensor with its lever arm at each accelerometer.
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "core/attitude.hpp"
#include "core/imu.hpp"
#include "tests/core/drive.hpp"

namespace imud {
namespace {

using namespace std::chrono_literals;

// Samples at 100 Hz of a turntable whose rate about z is rate + acceleration t.
std::vector<Sample> turntable(const ImuModel& model, double rate, double acceleration) {
  std::vector<TruthTime> times;
  for (int k = 0; k < 6; ++k) times.push_back(TruthTime{} + k * 10ms);
  return drive(
      model,
      [&](TruthTime time) {
        const double t = seconds(time - TruthTime{});
        Truth truth;
        truth.time = time;
        truth.q_NB = Quaternion(Eigen::AngleAxisd((rate + 0.5 * acceleration * t) * t, Vector3::UnitZ()));
        truth.omega_BN_B = {0, 0, rate + acceleration * t};
        truth.omegaDot_BN_B = {0, 0, acceleration};
        truth.has_angular_acceleration = true;
        truth.has_specific_force = true;
        return truth;
      },
      times, times);
}

ImuModel with_positions() {
  ImuModel model;
  model.accelerometer_positions << 0.03, 0.01, 0, 0.02, -0.04, 0, 0.05, 0.06, 0.07;
  return model;
}

TEST(SizeEffect, OnACentrifugeEachAccelerometerHasItsOwnRadius) {
  const std::vector<Sample> samples = turntable(with_positions(), 20, 0);
  // The centripetal force -w^2 rho: x sees 0.03 m, y -0.04 m, z nothing.
  const Vector3 force(-400 * 0.03, 400 * 0.04, 0);
  EXPECT_LT((samples[2].specific_force - force).norm(), 1e-10);
  EXPECT_LT((samples[2].delta_velocity - 0.01 * force).norm(), 1e-10);
  EXPECT_LT(samples[2].rate.head<2>().norm(), 1e-12);
}

TEST(SizeEffect, OnATurntableThatSpeedsUp) {
  constexpr double acceleration = 50;
  const std::vector<Sample> samples = turntable(with_positions(), 3, acceleration);
  const double t1 = 0.04, t2 = 0.05, w1 = 3 + acceleration * t1, w2 = 3 + acceleration * t2;
  // w' x rho + w x (w x rho) = (-w' y - w^2 x, w' x - w^2 y, 0); the integral of w^2 is (w2^3 - w1^3)/(3 w').
  EXPECT_LT((samples[5].specific_force -
             Vector3(-acceleration * 0.01 - w2 * w2 * 0.03, acceleration * 0.02 + w2 * w2 * 0.04, 0))
                .norm(),
            1e-9);
  const double squares = (w2 * w2 * w2 - w1 * w1 * w1) / (3 * acceleration), change = w2 - w1;
  EXPECT_LT((samples[5].delta_velocity - Vector3(-change * 0.01 - squares * 0.03, change * 0.02 + squares * 0.04, 0))
                .norm(),
            1e-9);
}

// Component i is that of a sensor whose lever arm leads to accelerometer i, in any axes and by any definition.
TEST(SizeEffect, IsALeverArmForEachAxis) {
  const std::vector<TruthTime> truths = instants(250, 400ms), samples = instants(100, 400ms);
  for (const DeltaVelocity definition : {DeltaVelocity::integral, DeltaVelocity::memo, DeltaVelocity::end_frame}) {
    ImuModel model = with_positions();
    model.delta_velocity = definition;
    model.r_SB_B = {0.5, -0.3, 0.8};
    model.dcm_PB = dcm_from_yaw_pitch_roll(0.5, -0.3, 2.0);
    const std::vector<Sample> all = drive(model, coning_truth, truths, samples);
    double effect = 0;
    for (int axis = 0; axis < 3; ++axis) {
      ImuModel moved = model;
      moved.accelerometer_positions.setZero();
      const std::vector<Sample> without = drive(moved, coning_truth, truths, samples);
      moved.r_SB_B += model.dcm_PB.transpose() * Vector3(model.accelerometer_positions.row(axis));
      const std::vector<Sample> expected = drive(moved, coning_truth, truths, samples);
      ASSERT_EQ(all.size(), 41U);
      for (std::size_t k = 0; k < all.size(); ++k) {
        EXPECT_NEAR(all[k].specific_force[axis], expected[k].specific_force[axis], 1e-11);
        EXPECT_NEAR(all[k].delta_velocity[axis], expected[k].delta_velocity[axis], 1e-13);
        EXPECT_EQ(all[k].rate, expected[k].rate);
        effect += std::abs(all[k].delta_velocity[axis] - without[k].delta_velocity[axis]);
      }
    }
    EXPECT_GT(effect, 1e-3);
  }
}

}  // namespace
}  // namespace imud
