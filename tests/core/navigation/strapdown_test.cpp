#include "core/navigation/strapdown.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "core/attitude.hpp"
#include "core/units.hpp"
#include "tests/core/body_motion.hpp"
#include "tests/core/drive.hpp"

namespace imud {
namespace {

const GravitationModel no_gravitation = {.kind = GravitationModel::Kind::none};
const GravitationModel down = {.kind = GravitationModel::Kind::constant};
const GravitationModel earth = {.kind = GravitationModel::Kind::wgs84};

// The samples of a motion of 0.5 rad/s, without errors, at 50 Hz; the first is the begin of the motion.
std::vector<Sample> ideal_samples(const IntegratedMotion& motion, DeltaAngle angle, DeltaVelocity velocity) {
  ImuModel model;
  model.rate_hz = 50;
  model.delta_angle = angle;
  model.delta_velocity = velocity;
  const auto truth_at = [&](TruthTime t) { return motion.truth(t); };
  return drive(model, truth_at, instants(1000, std::chrono::seconds(20)), instants(50, std::chrono::seconds(20)));
}

class StrapdownDefinitions : public ::testing::TestWithParam<std::tuple<DeltaAngle, DeltaVelocity>> {};

// Each definition of the increments leads to the motion. The residual coning and sculling of the two-sample
// corrections are of the fourth order in the 20 ms of a step: below 1e-7 rad and 2e-6 m/s here. Without the
// corrections the integrals would be off by 1e-4 rad and 1e-3 m/s.
TEST_P(StrapdownDefinitions, FollowTheMotion) {
  const auto [angle, velocity] = GetParam();
  const IntegratedMotion motion(smooth_motion(), 20);
  const std::vector<Sample> samples = ideal_samples(motion, angle, velocity);
  ASSERT_EQ(samples.size(), 1001U);
  Strapdown strapdown(no_gravitation, {angle, velocity});
  strapdown.begin({motion.q_NB(0), Vector3::Zero(), Vector3::Zero()});
  for (std::size_t k = 1; k < samples.size(); ++k)
    strapdown.advance(samples[k].delta_angle, samples[k].delta_velocity, 0.02);
  const InertialState& end = strapdown.state();
  EXPECT_LT(log(motion.q_NB(20).conjugate() * end.q_NP).norm(), 1e-7);
  EXPECT_LT((end.v_N - motion.dv_N(20)).norm(), 2e-6);
}

INSTANTIATE_TEST_SUITE_P(All, StrapdownDefinitions,
                         ::testing::Values(std::tuple(DeltaAngle::rotation_vector, DeltaVelocity::integral),
                                           std::tuple(DeltaAngle::integral, DeltaVelocity::integral),
                                           std::tuple(DeltaAngle::rotation_vector, DeltaVelocity::end_frame)));

// Turns at a constant rate w with a constant centripetal force: a circle of radius f/w^2, in closed form.
TEST(Strapdown, FliesACircle) {
  const double w = 0.2, f = 3, dt = 0.01;
  Strapdown strapdown(down);
  strapdown.begin({Quaternion::Identity(), {f / w, 0, 0}, {0, -f / (w * w), 0}});
  const Vector3 force(0, f, -units::standard_gravity);  // in turning axes; its integral there is constant
  for (int k = 1; k <= 60'000; ++k) {
    strapdown.advance({0, 0, w * dt}, dt * force, dt);
    if (k % 10'000 != 0) continue;
    const double t = k * dt, radius = f / (w * w);
    const Vector3 expected(radius * std::sin(w * t), -radius * std::cos(w * t), 0);
    EXPECT_LT((strapdown.state().r_N - expected).norm(), 2e-4) << t;
    EXPECT_LT((strapdown.state().v_N - w * radius * Vector3(std::cos(w * t), std::sin(w * t), 0)).norm(), 1e-5) << t;
  }
}

// The increments of a platform that stands on the rotating Earth at 45 degrees, with these constant errors.
struct Standing {
  static constexpr double dt = 0.1;
  Vector3 r_N = r_E_of({0.25 * units::pi, 0, 0});
  Quaternion q_NP = Quaternion(dcm_EL(0.25 * units::pi, 0));
  Vector3 rate_P = q_NP.conjugate() * Vector3(0, 0, units::earth_rate);
  Vector3 force_P = q_NP.conjugate() * Vector3(acceleration(r_N) - gravitation_N(earth, r_N));

  static Vector3 spin(const Vector3& r) { return Vector3(0, 0, units::earth_rate).cross(r); }
  static Vector3 acceleration(const Vector3& r) { return spin(spin(r)); }
  // Returns the error of the position after `seconds`, north, east, down, m. `hold_height`: it is held by another
  // sensor.
  Vector3 drift(const Vector3& gyro_bias, const Vector3& accelerometer_bias, double seconds, bool hold_height) const {
    Strapdown strapdown(earth);
    strapdown.begin({q_NP, spin(r_N), r_N});
    const auto steps = static_cast<int>(seconds / dt + 0.5);
    Vector3 there = r_N;
    for (int k = 1; k <= steps; ++k) {
      strapdown.advance(dt * (rate_P + gyro_bias), dt * (force_P + accelerometer_bias), dt);
      there = Eigen::AngleAxisd(units::earth_rate * dt * k, Vector3::UnitZ()) * r_N;
      if (!hold_height) continue;
      const Vector3 up = strapdown.state().r_N.normalized();
      const double height = strapdown.state().r_N.norm() - r_N.norm(), climb = strapdown.state().v_N.dot(up);
      strapdown.correct(Vector3::Zero(), -climb * up, -height * up);
    }
    const Vector3 error_E =
        Eigen::AngleAxisd(-units::earth_rate * dt * steps, Vector3::UnitZ()) * Vector3(strapdown.state().r_N - there);
    return q_NP.conjugate() * error_E;
  }
};

TEST(Strapdown, StandsOnTheRotatingEarth) {
  EXPECT_LT(Standing().drift(Vector3::Zero(), Vector3::Zero(), 600, false).norm(),
            5e-5);  // m, with 10 steps a second
}

// b t^2/2 and g w t^3/6 (Groves, section 14.2.3 and table 5.1): within 5 % up to 60 s.
TEST(Strapdown, DriftsAsABiasDoes) {
  const Standing platform;
  const double b = 0.01, w = 1e-4, g = 9.806;
  for (const double t : {10.0, 30.0, 60.0}) {
    EXPECT_NEAR(platform.drift(Vector3::Zero(), {b, 0, 0}, t, true).x(), 0.5 * b * t * t, 0.05 * 0.5 * b * t * t);
    const double turned = g * w * t * t * t / 6;
    EXPECT_NEAR(platform.drift({0, w, 0}, Vector3::Zero(), t, true).x(), -turned, 0.05 * turned);
  }
}

// With the height held, the error by an accelerometer's bias is b/ws^2 |1 - cos(ws t) exp(-i w t sin(latitude))|, of
// period 84.4 min: the Earth's rotation w turns the plane of the oscillation as Foucault's pendulum.
TEST(Strapdown, OscillatesWithSchulersPeriod) {
  const Standing platform;
  const double b = 1e-3, ws = std::sqrt(9.806 / 6.3675e6), half = units::pi / ws;
  EXPECT_NEAR(2 * half / 60, 84.4, 0.1);
  for (const double t : {0.5 * half, half, 2 * half, 3 * half}) {
    const double turned = units::earth_rate * std::sqrt(0.5) * t, c = std::cos(ws * t);
    const double expected = b / (ws * ws) * std::hypot(1 - c * std::cos(turned), c * std::sin(turned));
    const Vector3 error = platform.drift(Vector3::Zero(), {b, 0, 0}, t, true);
    EXPECT_NEAR(std::hypot(error.x(), error.y()), expected, 0.02 * b / (ws * ws)) << t;
  }
}

// The height without an aid: b/(2 ws^2) (cosh(sqrt 2 ws t) - 1).
TEST(Strapdown, HeightDivergesAlone) {
  const Standing platform;
  const double b = 1e-3, ws2 = 9.806 / 6.3675e6;
  for (const double t : {60.0, 600.0, 1800.0}) {
    const double expected = b / (2 * ws2) * (std::cosh(std::sqrt(2 * ws2) * t) - 1);
    EXPECT_NEAR(platform.drift(Vector3::Zero(), {0, 0, b}, t, false).z(), expected, 0.02 * expected) << t;
  }
}

}  // namespace
}  // namespace imud
