#include "core/navigation/attitude_filter.hpp"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <cmath>
#include <random>

#include "core/attitude.hpp"
#include "core/units.hpp"
#include "tests/support/allocations.hpp"

namespace imud {
namespace {

constexpr double ahrs_dt = 0.02, ahrs_g = units::standard_gravity;

Vector3 drawn(std::mt19937_64& random, double sigma) {
  std::normal_distribution<double> normal(0, sigma);
  const double x = normal(random), y = normal(random);
  return {x, y, normal(random)};
}

AttitudeTuning quiet_tuning() {
  return {.noise = {.gyro = 1e-4, .accelerometer = 1e-3, .gyro_walk = 1e-5}, .acceleration = 0.2};
}

AttitudeFilter::Covariance first_covariance(double tilt, double heading, double bias) {
  AttitudeFilter::State sigma;
  sigma << tilt, tilt, heading, bias, bias, bias;
  return sigma.cwiseProduct(sigma).asDiagonal();
}

// A platform that rocks about north, and does not turn about down; its accelerometers are noisy. `noise` acts; the
// filter is tuned for `rocking_noise`.
const InertialNoise rocking_noise = {.gyro = 3e-5, .accelerometer = 0.05, .gyro_walk = 1e-5};

double mean_rocking_nees(const InertialNoise& noise, bool has_headings) {
  constexpr double tilt = 0.02, heading_sigma = 0.1, bias = 1e-3, of_compass = 0.03;
  double sum = 0;
  int count = 0;
  for (unsigned seed = 1; seed <= 40; ++seed) {
    std::mt19937_64 random(seed);
    AttitudeFilter filter({}, {.noise = rocking_noise, .acceleration = 1e-4});
    Quaternion q_LP = Quaternion::Identity();
    const Vector3 first = drawn(random, 1).cwiseProduct(Vector3(tilt, tilt, heading_sigma));
    filter.begin(exp(-first) * q_LP, first_covariance(tilt, heading_sigma, bias));
    Vector3 gyro_bias = drawn(random, bias);
    for (int k = 1; k <= 5000; ++k) {
      const Vector3 turn(ahrs_dt * 0.1 * std::sin(0.5 * ahrs_dt * k), 0, 0);
      const Vector3 force_P = (q_LP * exp(0.5 * turn)).conjugate() * Vector3(0, 0, -ahrs_g);
      q_LP = (q_LP * exp(turn)).normalized();
      gyro_bias += drawn(random, noise.gyro_walk * std::sqrt(ahrs_dt));
      filter.advance(turn + ahrs_dt * gyro_bias + drawn(random, noise.gyro * std::sqrt(ahrs_dt)),
                     ahrs_dt * force_P + drawn(random, noise.accelerometer * std::sqrt(ahrs_dt)), ahrs_dt);
      if (has_headings && k % 50 == 0)
        filter.update({.innovation = log(q_LP * filter.q_LP().conjugate()).z() + drawn(random, of_compass).x(),
                       .variance = of_compass * of_compass});
      if (k % 1000 != 0) continue;
      AttitudeFilter::State error;
      error << log(q_LP * filter.q_LP().conjugate()), gyro_bias - filter.gyro_bias_P();
      sum += error.dot(filter.covariance().llt().solve(error));
      ++count;
    }
  }
  return sum / count;
}

// The sum of 200 squares of 6 degrees of freedom has a standard deviation of sqrt(2 x 6 x 200): the mean is within
// 6 +- 1.2 with a probability of false alarm of 1e-6, were all independent. Without headings the heading's error of
// the five instants is one draw each run, which adds.
TEST(AttitudeFilter, IsConsistent) {
  EXPECT_NEAR(mean_rocking_nees(rocking_noise, true), 6, 1.2);
  EXPECT_NEAR(mean_rocking_nees(rocking_noise, false), 6, 1.8);
}
TEST(AttitudeFilter, NoisierSensorsShow) {
  EXPECT_GT(mean_rocking_nees({.gyro = 9e-5, .accelerometer = 0.15, .gyro_walk = 3e-5}, true), 10);
}

// From a tilt of 14 degrees, with a bias of 0.5 deg/s on every gyro, to a hundredth of a degree and a thousandth of a
// degree per second, where gravity shows them.
TEST(AttitudeFilter, ConvergesFromATilt) {
  AttitudeFilter filter({}, quiet_tuning());
  const Vector3 bias = Vector3::Constant(0.5 * units::degree);
  filter.begin(exp(Vector3(0.2, -0.15, 0)), first_covariance(0.2, 0.1, 0.01));
  for (int k = 0; k < 600 / ahrs_dt; ++k) filter.advance(ahrs_dt * bias, {0, 0, -ahrs_dt * ahrs_g}, ahrs_dt);
  const Vector3 up_L = filter.q_LP() * Vector3(0, 0, -1);
  EXPECT_LT(up_L.head<2>().norm(), 0.01 * units::degree);
  EXPECT_LT((filter.gyro_bias_P() - bias).head<2>().norm(), 1e-3 * units::degree);
  EXPECT_LT(filter.covariance()(0, 0), 1e-4);
  EXPECT_GT(filter.covariance()(2, 2), 0.01);  // gravity does not show a heading
}

TEST(AttitudeFilter, AllowsForManoeuvres) {
  AttitudeFilter filter({}, quiet_tuning());
  const auto after = [&](double seconds, double force, double rate) {
    for (int k = 0; k < seconds / ahrs_dt; ++k)
      filter.advance({0, 0, ahrs_dt * rate}, {0, 0, -ahrs_dt * force}, ahrs_dt);
    return filter.manoeuvre2();
  };
  filter.begin(Quaternion::Identity(), first_covariance(0.01, 0.01, 1e-4));
  EXPECT_LT(after(1, ahrs_g, 0), 1e-9);
  EXPECT_LT(after(1, ahrs_g + 0.03, 0), 1e-9);
  const double margin = AttitudeFilter::gravity_of_place + 3 * 1e-3 / std::sqrt(ahrs_dt);
  EXPECT_NEAR(after(0.1, ahrs_g + 2, 0), std::pow(2 - margin, 2), 1e-9);
  EXPECT_NEAR(after(0.1, ahrs_g - 3, 0), std::pow(3 - margin, 2), 1e-9);
  const double before = filter.manoeuvre2();
  EXPECT_NEAR(after(1, ahrs_g, 0), before * std::exp(-1), 0.02 * before);
  after(30, ahrs_g, 0);
  EXPECT_NEAR(after(0.1, ahrs_g, 0.1), std::pow(0.1 * AttitudeFilter::turning_speed, 2), 1e-3);
  EXPECT_NEAR(after(0.1, ahrs_g, 20), std::pow(AttitudeFilter::largest_turn, 2), 1e-9);
}

// Rounding leaves the covariance symmetric to the last bit, and positive definite; two runs have the same bits, and
// nothing is allocated.
TEST(AttitudeFilter, StaysDefiniteAndTheSame) {
  AttitudeFilter first({}, quiet_tuning()), second({}, quiet_tuning());
  for (AttitudeFilter* filter : {&first, &second}) {
    std::mt19937_64 random(1);
    filter->begin(Quaternion::Identity(), first_covariance(0.1, 3, 1e-2));
    for (int k = 0; k < 100'000; ++k) {
      const Vector3 turn = drawn(random, 0.01), dv = Vector3(0, 0, -ahrs_dt * ahrs_g) + drawn(random, 0.02);
      const std::uint64_t allocated = allocations();
      filter->advance(turn, dv, ahrs_dt);
      if (k % 5 == 0) filter->update({.innovation = 0.01, .variance = 1e-3});
      ASSERT_EQ(allocations(), allocated);
      if (k % 1000 != 0) continue;
      const AttitudeFilter::Covariance& P = filter->covariance();
      ASSERT_TRUE((P.array() == P.transpose().array()).all()) << k;
      ASSERT_EQ(P.llt().info(), Eigen::Success) << k;
    }
  }
  EXPECT_EQ(first.q_LP().coeffs(), second.q_LP().coeffs());
  EXPECT_EQ(first.covariance(), second.covariance());
}

}  // namespace
}  // namespace imud
