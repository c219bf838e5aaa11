// The three definitions of delta-velocity, step by step, against closed forms and against dense integration.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include "core/attitude.hpp"
#include "core/imu.hpp"
#include "tests/core/body_motion.hpp"
#include "tests/core/drive.hpp"

namespace imud {
namespace {

using namespace std::chrono_literals;

const Vector3 lever_arm_B(0.5, -0.3, 0.8);

// A faster motion than that of the vectors, with rates and forces in phase (sculling) in all axes.
BodyMotion lively_motion() {
  return {[](double t) {
            return Vector3(1.0 * std::cos(9.0 * t), 0.6 * std::sin(7.0 * t + 0.4), 0.5 - 0.8 * std::cos(5.0 * t));
          },
          [](double t) {
            return Vector3(-9.0 * std::sin(9.0 * t), 4.2 * std::cos(7.0 * t + 0.4), 4.0 * std::sin(5.0 * t));
          },
          [](double t) {
            return Vector3(2.0 + 3.0 * std::sin(7.0 * t), 4.0 * std::sin(9.0 * t), -9.8 + 2.0 * std::cos(11.0 * t));
          }};
}
const IntegratedMotion& lively() {
  static const IntegratedMotion motion(lively_motion(), 2.5);
  return motion;
}

double at(TruthTime t) { return seconds(t - TruthTime{}); }

// The specific force at the sensor's point, in B.
Vector3 force_at_sensor(double t) {
  const Vector3 omega = lively().omega_BN_B(t);
  return lively().specific_force_B(t) + lively_motion().omega_dot(t).cross(lever_arm_B) +
         omega.cross(omega.cross(lever_arm_B));
}

Vector3 integral_of_force(double t1, double t2) {  // Simpson's rule
  constexpr int n = 50;
  Vector3 sum = Vector3::Zero();
  for (int i = 0; i <= 2 * n; ++i)
    sum += (i == 0 || i == 2 * n ? 1.0 : i % 2 == 1 ? 4.0 : 2.0) * force_at_sensor(t1 + (t2 - t1) * i / (2 * n));
  return (t2 - t1) / (6 * n) * sum;
}

// Eq. 10-14, each truth's increment in the body axes at its end, and the last piece's at the sensor's instant.
Vector3 memo(TruthTime t1, TruthTime t2, const std::vector<TruthTime>& truths) {
  Vector3 sum = (lively().omega_BN_B(at(t2)) - lively().omega_BN_B(at(t1))).cross(lever_arm_B);
  double from = at(t1);
  const auto add = [&](double to) {
    sum += lively().q_NB(to).conjugate() * (lively().dv_N(to) - lively().dv_N(from));
    from = to;
  };
  for (const TruthTime t : truths)
    if (t > t1 && t < t2) add(at(t));
  add(at(t2));
  return sum;
}

Vector3 end_frame(double t1, double t2) {
  const auto velocity_N = [](double t) {
    return Vector3(lively().dv_N(t) + lively().q_NB(t) * lively().omega_BN_B(t).cross(lever_arm_B));
  };
  return lively().q_NB(t2).conjugate() * (velocity_N(t2) - velocity_N(t1));
}

struct StepRates {
  std::string name;
  double truth_hz, sensor_hz;
  // Tolerance, m/s per step; increments are about 10 m/s^2 times the step. Between truths h apart, the error of the
  // interpolated rate at the lever arm dominates: 2 * 0.008 h^3 * 729 rad/s^4 * 1 m.
  double tolerance;
};

class DeltaVelocities : public ::testing::TestWithParam<StepRates> {
 protected:
  const std::vector<TruthTime> truths = instants(GetParam().truth_hz, 2s);
  const std::vector<TruthTime> sensor = instants(GetParam().sensor_hz, 2s);

  void compare(DeltaVelocity kind, const std::function<Vector3(TruthTime, TruthTime)>& expected) const {
    ImuModel model;
    model.r_SB_B = lever_arm_B;
    model.dcm_PB = dcm_from_yaw_pitch_roll(0.5, -0.3, 2.0);
    model.delta_velocity = kind;
    const std::vector<Sample> samples = drive(
        model, [](TruthTime t) { return lively().truth(t); }, truths, sensor);
    ASSERT_GT(samples.size(), 10U);
    double worst = 0;
    for (std::size_t i = 1; i < samples.size(); ++i)
      worst = std::max(worst, (samples[i].delta_velocity - model.dcm_PB * expected(sensor[i - 1], sensor[i])).norm());
    EXPECT_LT(worst, GetParam().tolerance);
  }
};

TEST_P(DeltaVelocities, Integral) {
  compare(DeltaVelocity::integral, [](TruthTime t1, TruthTime t2) { return integral_of_force(at(t1), at(t2)); });
}
TEST_P(DeltaVelocities, Memo) {
  compare(DeltaVelocity::memo, [this](TruthTime t1, TruthTime t2) { return memo(t1, t2, truths); });
}
TEST_P(DeltaVelocities, EndFrame) {
  compare(DeltaVelocity::end_frame, [](TruthTime t1, TruthTime t2) { return end_frame(at(t1), at(t2)); });
}

INSTANTIATE_TEST_SUITE_P(Rates, DeltaVelocities,
                         ::testing::Values(StepRates{"equal", 100, 100, 1e-7},
                                           StepRates{"many_truths_in_a_step", 1000, 20, 1e-9},
                                           StepRates{"many_steps_between_truths", 50, 1000, 9e-5},
                                           StepRates{"truth_much_faster", 1000, 100, 1e-10},
                                           StepRates{"incommensurate", 333.333, 77.7, 3.2e-7},
                                           StepRates{"incommensurate_slow_truth", 97.3, 400, 1.3e-5}),
                         [](const auto& test) { return test.param.name; });

// A lever arm on a turntable. The accelerometers sense the constant centripetal force; the memo's Eq. 12, a
// difference of body components, does not contain it.
TEST(DeltaVelocity, CentripetalForceOnALeverArm) {
  const double omega = 2.0, h = 0.05;
  const auto truth_at = [&](TruthTime t) {
    Truth truth;
    truth.time = t;
    truth.q_NB = Quaternion(Eigen::AngleAxisd(omega * at(t), Vector3::UnitZ()));
    truth.omega_BN_B = {0.0, 0.0, omega};
    truth.has_angular_acceleration = truth.has_specific_force = true;
    return truth;
  };
  const auto second = [&](DeltaVelocity kind) {
    ImuModel model;
    model.r_SB_B = {0.7, 0.0, 0.2};
    model.delta_velocity = kind;
    return drive(model, truth_at, instants(100, 1s), instants(1.0 / h, 1s))[2].delta_velocity;
  };
  const double w = omega * omega * 0.7, x = omega * h;
  EXPECT_LT((second(DeltaVelocity::integral) - Vector3(-w * h, 0.0, 0.0)).norm(), 1e-14);
  EXPECT_LT((second(DeltaVelocity::memo) - Vector3::Zero()).norm(), 1e-14);
  // The sensor's velocity, 1.4 m/s along y, has turned by x since the step began, as seen from its end.
  EXPECT_LT((second(DeltaVelocity::end_frame) - 1.4 * Vector3(-std::sin(x), 1.0 - std::cos(x), 0.0)).norm(), 1e-14);
}

// Constant specific force on a turning body: what an accelerometer accumulates does not depend on the turn.
TEST(DeltaVelocity, ConstantForceOnATurningBody) {
  const double omega = 2.0, f = 5.0;
  for (const double truth_hz : {20.0, 100.0, 1000.0}) {
    const auto truth_at = [&](TruthTime t) {
      const double x = omega * at(t);
      Truth truth;
      truth.time = t;
      truth.q_NB = Quaternion(Eigen::AngleAxisd(x, Vector3::UnitZ()));
      truth.omega_BN_B = {0.0, 0.0, omega};
      truth.has_angular_acceleration = truth.has_specific_force = true;
      truth.specific_force_B = {f, 0.0, 0.0};
      truth.accumulated_dv = AccumulatedDv::inertial;
      truth.accumulated_dv_B = truth.q_NB.conjugate() * (f / omega * Vector3(std::sin(x), 1.0 - std::cos(x), 0.0));
      return truth;
    };
    const auto worst = [&](DeltaVelocity kind, const Vector3& expected) {
      ImuModel model;
      model.delta_velocity = kind;
      double error = 0;
      for (const Sample& sample : drive(model, truth_at, instants(truth_hz, 1s), instants(20, 1s)))
        if (sample.counter > 0) error = std::max(error, (sample.delta_velocity - expected).norm());
      return error;
    };
    const double x = omega * 0.05, h = 1.0 / truth_hz;
    EXPECT_LT(worst(DeltaVelocity::integral, {0.05 * f, 0.0, 0.0}), 1e-14 + 0.02 * std::pow(h, 4)) << truth_hz;
    // Turned back from the end, the force came from the left of where it is now.
    EXPECT_LT(worst(DeltaVelocity::end_frame, f / omega * Vector3(std::sin(x), std::cos(x) - 1.0, 0.0)), 1e-14);
    const double y = omega * h;  // the same in each truth step
    EXPECT_LT(worst(DeltaVelocity::memo, f / omega * (0.05 / h) * Vector3(std::sin(y), std::cos(y) - 1.0, 0.0)),
              1e-14);
  }
}

}  // namespace
}  // namespace imud
