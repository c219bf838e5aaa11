#include "core/navigation_errors.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "core/imu.hpp"

namespace imud {
namespace {

// A vehicle that flies north at 100 m/s over Earth-fixed axes, and its sensor, which looks north.
class NavigationErrorTest : public testing::Test {
 protected:
  NavigationErrorTest() {
    model_.earth.frame = EarthModel::Frame::local;
    model_.earth.latitude = 0.8;
    for (int k = 0; k <= 20; ++k) {
      Truth truth;
      truth.time.ns = k * 100'000'000;
      truth.has_position = truth.has_velocity = true;
      truth.v_BN_N = {100, 0, 0};
      truth.r_BN_N = {10.0 * k, 0, 0};
      timeline_.push(truth);
    }
  }
  Sample sample(std::uint64_t k = 0) const {
    Imu imu(model_, 1, 1);
    imu.seek(k);
    return imu.sample(timeline_, TruthTime{1'500'000'000}, {});
  }
  // Returns the error, north, east and down.
  static Vector3 distance(const Sample& from, const Sample& to) {
    return dcm_EL(from.navigation.latitude, from.navigation.longitude).transpose() *
           (to.navigation.r_E - from.navigation.r_E);
  }

  ImuModel model_;
  Timeline timeline_;
};

TEST_F(NavigationErrorTest, LatencyGivesTheStateBeforeWithTheTimeOfNow) {
  const Sample now = sample();
  model_.navigation.latency = std::chrono::milliseconds(250);
  const Sample late = sample();
  // 25 m less to the north; the tangent plane is 0.3 mm above the ellipsoid there.
  EXPECT_LT((distance(now, late) - Vector3(-25, 0, 0)).norm(), 1e-2);
  EXPECT_NEAR(late.navigation.latitude, now.navigation.latitude - 25 / 6.37e6, 5e-8);
  EXPECT_EQ(late.navigation.gps_ns, now.navigation.gps_ns);
  EXPECT_EQ(late.rate, now.rate);
}

// The mean squares of 4000 samples of white noise lie within 5 of their standard deviations, sqrt(2/4000); each of
// the ten checks fails without cause below 1e-6. Seeking makes samples that are far apart in the sequence, whose
// correlated errors are independent as well.
TEST_F(NavigationErrorTest, ComponentsHaveTheirStandardDeviations) {
  const Sample truth = sample();
  model_.navigation.position = {3, 2, 5};
  model_.navigation.position_noise = {4, 0, 0};
  model_.navigation.velocity = {0.1, 0.2, 0.3};
  model_.navigation.attitude = {1e-3, 1e-3, 1e-2};
  model_.navigation.position_correlation_s = model_.navigation.velocity_correlation_s =
      model_.navigation.attitude_correlation_s = model_.navigation.time_correlation_s = 1e-3;  // a tenth of a sample
  model_.navigation.time_s = 1e-6;
  constexpr int n = 4000;
  Vector3 position = Vector3::Zero(), velocity = Vector3::Zero(), attitude = Vector3::Zero();
  double time = 0;
  Imu imu(model_, 1, 1);
  for (int k = 0; k < n; ++k) {
    const Sample s = imu.sample(timeline_, TruthTime{1'500'000'000 + k}, {});
    position += distance(truth, s).cwiseAbs2();
    velocity += (s.navigation.v_L - truth.navigation.v_L).cwiseAbs2();
    attitude += log(s.q_LP * truth.q_LP.conjugate()).cwiseAbs2();
    const auto late_ns = static_cast<double>(s.navigation.gps_ns - truth.navigation.gps_ns - k);
    time += 1e-18 * late_ns * late_ns;
  }
  const double bound = 5 * std::sqrt(2.0 / n);
  EXPECT_NEAR(time / n / 1e-12, 1, bound);
  const auto expect = [&](const Vector3& sum, const Vector3& sigma) {
    for (int i = 0; i < 3; ++i) EXPECT_NEAR(sum[i] / n / (sigma[i] * sigma[i]), 1, bound) << i;
  };
  expect(position, {5, 2, 5});
  expect(velocity, {0.1, 0.2, 0.3});
  expect(attitude, {1e-3, 1e-3, 1e-2});
}

// The mean square of 4000 azimuths lies within 5 of its standard deviations. A fault without cause is below 1e-6.
TEST_F(NavigationErrorTest, TwoAntennasMeasureTheTrueAttitude) {
  const Sample truth = sample();
  EXPECT_EQ(truth.antennas(), nullptr);
  model_.navigation.antennas_heading = 0.01;
  const Sample measured = sample();
  ASSERT_NE(measured.antennas(), nullptr);
  EXPECT_EQ(measured.antennas()->sigma, 0.01);
  EXPECT_EQ(measured.navigation.r_E, truth.navigation.r_E) << "nothing else has errors";
  EXPECT_EQ(measured.navigation.latitude, truth.navigation.latitude);
  EXPECT_EQ(measured.navigation.gps_ns, truth.navigation.gps_ns);
  EXPECT_EQ(measured.q_LP.coeffs(), truth.q_LP.coeffs());
  model_.navigation.attitude = {0.1, 0.1, 0.5};
  constexpr int n = 4000;
  double square = 0;
  Imu imu(model_, 1, 1);
  for (int k = 0; k < n; ++k) {
    const Vector3 line = imu.sample(timeline_, TruthTime{1'500'000'000 + k}, {}).antennas()->direction_L;
    const Vector3 ahead = truth.q_LP * Vector3::UnitX();
    EXPECT_NEAR(line.z(), ahead.z(), 1e-9);
    square += std::pow(std::atan2(line.y(), line.x()) - std::atan2(ahead.y(), ahead.x()), 2);
  }
  EXPECT_NEAR(square / n / 1e-4, 1, 5 * std::sqrt(2.0 / n));
  model_.earth.frame = EarthModel::Frame::none;
  EXPECT_EQ(sample().navigation.antennas.sigma, 0) << "no fix";
}

TEST_F(NavigationErrorTest, ASampleHasTheErrorsOfTheSequence) {
  model_.navigation.position = model_.navigation.velocity = Vector3::Ones();
  model_.navigation.attitude = Vector3::Constant(0.01);
  model_.navigation.time_s = 1e-3;
  Imu imu(model_, 1, 1);
  Sample last;
  for (int k = 0; k <= 100; ++k) last = imu.sample(timeline_, TruthTime{1'400'000'000 + k * 1'000'000}, {});
  const Sample sought = sample(100);
  EXPECT_EQ(sought.navigation.r_E, last.navigation.r_E);
  EXPECT_EQ(sought.navigation.v_L, last.navigation.v_L);
  EXPECT_EQ(sought.q_LP.coeffs(), last.q_LP.coeffs());
  EXPECT_EQ(sought.navigation.gps_ns, last.navigation.gps_ns);
}

// A magnetometer measures the true field, whatever a filter thinks of the attitude.
TEST_F(NavigationErrorTest, TheSensorsMeasureTheTruth) {
  const Sample truth = sample();
  model_.navigation.position = Vector3::Constant(100);
  model_.navigation.attitude = Vector3::Constant(0.1);
  const Sample s = sample();
  EXPECT_GT((s.q_LP.coeffs() - truth.q_LP.coeffs()).norm(), 1e-3);
  EXPECT_EQ(s.magnetic_field, truth.magnetic_field);
  EXPECT_EQ(s.pressure, truth.pressure);
}

}  // namespace
}  // namespace imud
