// Coning and sculling: motions whose increments, and whose neglected terms, are known in closed form.
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "core/attitude.hpp"
#include "core/imu.hpp"
#include "tests/core/drive.hpp"
#include "tools/truth/motion.hpp"

namespace imud {
namespace {

using namespace std::chrono_literals;

constexpr double a = 0.02;                              // half-angle, rad
constexpr double W = 2.0 * 3.14159265358979324 * 10.0;  // 10 Hz
constexpr Nanoseconds duration = 10s;                   // 100 turns
constexpr double T = 10.0;

std::vector<Vector3> delta_angles(DeltaAngle kind, double truth_hz, double sensor_hz) {
  ImuModel model;
  model.delta_angle = kind;
  std::vector<Vector3> result;
  for (const Sample& sample : drive(model, coning_truth, instants(truth_hz, duration), instants(sensor_hz, duration)))
    if (sample.counter > 0) result.push_back(sample.delta_angle);
  return result;
}

double mean_z_rate(const std::vector<Vector3>& angles) {
  Vector3 sum = Vector3::Zero();
  for (const Vector3& angle : angles) sum += angle;
  return sum.z() / T;
}

// The rate about z at which an attitude drifts that is composed of one rotation vector per `n` increments.
template <class Combine>
double drift(const std::vector<Vector3>& angles, std::size_t n, Combine combine) {
  Quaternion q = coning_truth({}).q_NB;
  for (std::size_t i = 0; i + n <= angles.size(); i += n) q = q * exp(combine(&angles[i]));
  return log(q * coning_truth(TruthTime{} + duration).q_NB.conjugate()).z() / T;
}

struct Rates {
  double truth_hz, sensor_hz;
  // The relative error that interpolation between truths may cause; its own error is (W/truth_hz)^4/384.
  double interpolation() const { return truth_hz < sensor_hz ? std::pow(W / truth_hz, 4) / 300.0 : 1e-12; }
};
class Coning : public ::testing::TestWithParam<Rates> {};

// W (1 - cos a), the constant rate about z.
TEST_P(Coning, RectifiedRate) {
  const Rates& rates = GetParam();
  const double rectified = mean_z_rate(delta_angles(DeltaAngle::integral, rates.truth_hz, rates.sensor_hz));
  EXPECT_NEAR(rectified / -1.256595e-2, 1.0, 1e-6 + rates.interpolation());
  EXPECT_NEAR(rectified / (-W * (1.0 - std::cos(a))), 1.0, rates.interpolation());
}

// Summing the integrals of the rate as if they were rotations leaves a^2 W (W T)^2/12 for small steps T, in full
// a^2 W/2 (1 - sin WT/WT). With ten truths a turn the integrals' own error shows.
TEST_P(Coning, RawSumDrifts) {
  const Rates& rates = GetParam();
  const double WT = W / rates.sensor_hz;
  const double expected = a * a * W / 2.0 * (1.0 - std::sin(WT) / WT);
  const double raw = drift(delta_angles(DeltaAngle::integral, rates.truth_hz, rates.sensor_hz), 1,
                           [](const Vector3* v) { return v[0]; });
  const double tolerance = rates.truth_hz <= 100.0 ? 1e-2 : rates.truth_hz <= 200.0 ? 6e-3 : 2e-4;
  EXPECT_NEAR(std::abs(raw) / expected, 1.0, tolerance);
  if (rates.sensor_hz == 100.0) {
    EXPECT_NEAR(std::abs(raw), 8.11e-4, tolerance * 8.11e-4 + 0.005e-4);
  }
}

TEST_P(Coning, RotationVectorsDoNotDrift) {
  const Rates& rates = GetParam();
  const std::vector<Vector3> angles = delta_angles(DeltaAngle::rotation_vector, rates.truth_hz, rates.sensor_hz);
  EXPECT_NEAR(drift(angles, 1, [](const Vector3* v) { return v[0]; }), 0.0, 1e-13);
  // Their mean about z is the rectified rate less the drift of the raw sum.
  const double WT = W / rates.sensor_hz;
  EXPECT_NEAR(mean_z_rate(angles), -W * (1.0 - std::cos(a)) + a * a * W / 2.0 * (1.0 - std::sin(WT) / WT), 1e-6);
}

INSTANTIATE_TEST_SUITE_P(Rates, Coning,
                         ::testing::Values(Rates{100, 100}, Rates{200, 200}, Rates{200, 100}, Rates{1000, 100},
                                           Rates{1000, 50}, Rates{1000, 1000}, Rates{200, 1000}));

// The algorithms that navigators use on the integrals, over T = 10 ms, with their known residues: a^2 W (WT)^4/960
// for two samples, a^2 W (WT)^6/204120 for three. (R. B. Miller, J. Guidance 6(4), 1983; M. B. Ignagni, 19(2), 1996.)
TEST(ConingAlgorithm, TwoSamples) {
  const std::vector<Vector3> angles = delta_angles(DeltaAngle::integral, 1000, 200);
  const double residue =
      drift(angles, 2, [](const Vector3* v) { return Vector3(v[0] + v[1] + 2.0 / 3.0 * v[0].cross(v[1])); });
  EXPECT_NEAR(std::abs(residue), 4.04e-6, 0.02e-6);
}

TEST(ConingAlgorithm, ThreeSamples) {
  const std::vector<Vector3> angles = delta_angles(DeltaAngle::integral, 3000, 300);
  const double residue = drift(angles, 3, [](const Vector3* v) {
    return Vector3(v[0] + v[1] + v[2] + 9.0 / 20.0 * v[0].cross(v[2]) + 27.0 / 40.0 * v[1].cross(v[2] - v[0]));
  });
  EXPECT_NEAR(std::abs(residue), 7.57e-9, 0.05e-9);
}

// --- Sculling: rocking about x by A sin Wt with a force B sin Wt along y, in phase
// ------------------------------------

constexpr double A = 0.02, B = 3.0;

Truth sculling_truth(TruthTime time) {
  const double t = seconds(time - TruthTime{});
  const double s = std::sin(W * t), c = std::cos(W * t);
  Truth truth;
  truth.time = time;
  truth.q_NB = Quaternion(Eigen::AngleAxisd(A * s, Vector3::UnitX()));
  truth.omega_BN_B = {A * W * c, 0.0, 0.0};
  truth.has_angular_acceleration = truth.has_specific_force = true;
  truth.omegaDot_BN_B = {-A * W * W * s, 0.0, 0.0};
  truth.specific_force_B = {0.0, B * s, 0.0};
  return truth;
}

// Its velocity in N: the integral of B sin Wt (cos, sin)(A sin Wt), by Simpson's rule over each truth step.
struct ScullingStream {
  Vector3 dv_N = Vector3::Zero();
  TruthTime previous = {};

  Truth operator()(TruthTime time) {
    const auto force_N = [](double t) {
      const double s = std::sin(W * t);
      return Vector3(0.0, B * s * std::cos(A * s), B * s * std::sin(A * s));
    };
    constexpr int n = 8;
    const double from = seconds(previous - TruthTime{}), h = seconds(time - previous) / n;
    for (int i = 0; i < n; ++i) {
      const double t = from + h * i;
      dv_N += h / 6.0 * (force_N(t) + 4.0 * force_N(t + 0.5 * h) + force_N(t + h));
    }
    previous = time;
    Truth truth = sculling_truth(time);
    truth.accumulated_dv = AccumulatedDv::inertial;
    truth.accumulated_dv_B = truth.q_NB.conjugate() * dv_N;
    return truth;
  }
};

std::vector<Sample> sculling_samples(DeltaVelocity kind, double truth_hz, double sensor_hz) {
  ImuModel model;
  model.delta_velocity = kind;
  return drive(model, ScullingStream{}, instants(truth_hz, duration), instants(sensor_hz, duration));
}

// B J1(A): what the force along y makes of velocity along N's z.
TEST(Sculling, EndFrameNavigatesToTheRectifiedVelocity) {
  Quaternion q_NB = sculling_truth({}).q_NB;
  Vector3 v_N = Vector3::Zero();
  for (const Sample& sample : sculling_samples(DeltaVelocity::end_frame, 1000, 100)) {
    q_NB = q_NB * exp(sample.delta_angle);
    v_N += q_NB * sample.delta_velocity;
  }
  EXPECT_NEAR(v_N.z() / T, B * std::cyl_bessel_j(1.0, A), 1e-10);
}

// The accelerometer along z senses nothing; a navigator that uses half the rotation vector for the attitude in the
// middle of its steps T finds sin(WT)/WT of the velocity, and must compensate for the rest.
TEST(Sculling, IntegralIsWhatTheAccelerometersFeel) {
  for (const double truth_hz : {100.0, 1000.0}) {
    Quaternion q_NB = sculling_truth({}).q_NB;
    Vector3 sum_B = Vector3::Zero(), v_N = Vector3::Zero();
    for (const Sample& sample : sculling_samples(DeltaVelocity::integral, truth_hz, 100)) {
      v_N += q_NB * exp(0.5 * sample.delta_angle) * sample.delta_velocity;
      q_NB = q_NB * exp(sample.delta_angle);
      sum_B += sample.delta_velocity;
      // At the truth's own instants the force along y is known, and so is its integral.
      const double t2 = 0.01 * static_cast<double>(sample.counter), t1 = std::max(0.0, t2 - 0.01);
      ASSERT_NEAR(sample.delta_velocity.y(), B / W * (std::cos(W * t1) - std::cos(W * t2)), 4e-3 / truth_hz);
    }
    EXPECT_NEAR(sum_B.z() / T, 0.0, truth_hz == 100.0 ? 1e-5 : 1e-9);
    const double WT = W / 100.0;
    EXPECT_NEAR(v_N.z() / T / (A * B / 2.0), std::sin(WT) / WT, 5e-4);
  }
}

}  // namespace
}  // namespace imud
