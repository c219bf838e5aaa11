#include "core/navigation/inertial_filter.hpp"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <cmath>
#include <random>
#include <vector>

#include "core/attitude.hpp"
#include "core/units.hpp"

namespace imud {
namespace {

using Filter = InertialFilter;
constexpr double dt = 0.02, g = units::standard_gravity;
const GravitationModel flat_earth = {.kind = GravitationModel::Kind::constant};
const InertialNoise mems = {1e-4, 1e-3, 1e-6, 1e-5};

Vector3 draw(std::mt19937_64& random, double sigma) {
  std::normal_distribution<double> normal;  // a distribution with the standard deviation 0 is not allowed
  const double x = sigma * normal(random), y = sigma * normal(random);
  return {x, y, sigma * normal(random)};
}

// The standard deviations of the errors at the begin. Without aids they must be small, as the errors of the filter's
// linear model grow with their square.
Filter::State first_sigma(bool has_aids = true) {
  Filter::State sigma;
  sigma << 0.02, 0.02, 0.05, 0.2, 0.2, 0.2, 2, 2, 3, 1e-3, 1e-3, 1e-3, 0.02, 0.02, 0.02;
  return has_aids ? sigma : Filter::State(0.01 * sigma);
}

// A flight with turns, climbs and accelerations, whose true motion follows from true increments by the same
// equations, and a filter that has measured increments. `noise` acts; the filter is tuned for `mems`. The sensors
// have scale factors where the filter estimates them.
class Flight {
 public:
  Flight(unsigned seed, const InertialNoise& noise, bool has_aids, const Filter::ScaleSigmas& scale = {},
         const InertialNoise& tuning = mems)
      : random_(seed), noise_(noise), has_aids_(has_aids), filter_(flat_earth, {}, tuning) {
    filter_.estimate_scale_factors(scale);
    Filter::State error = first_sigma(has_aids);
    for (int i = 0; i < Filter::states; i += 3) error.segment<3>(i).array() *= draw(random_, 1).array();
    const InertialState start = {exp(Vector3(0.1, -0.2, 1)), {20, -10, 1}, {100, 200, -300}};
    truth_.begin(start);
    gyro_bias_ = error.segment<3>(Filter::gyro_bias);
    accelerometer_bias_ = error.segment<3>(Filter::accelerometer_bias);
    const Filter::State variance = first_sigma(has_aids).cwiseProduct(first_sigma(has_aids));
    filter_.begin({exp(-Vector3(error.segment<3>(Filter::phi))) * start.q_NP,
                   start.v_N - error.segment<3>(Filter::velocity), start.r_N - error.segment<3>(Filter::position)},
                  Vector3::Zero(), Vector3::Zero(), variance.asDiagonal());
    set_scale_factors(draw(random_, scale.gyro), draw(random_, scale.accelerometer));
    const double walk = std::sqrt(Filter::scale_growth * dt);
    scale_walk_ = {walk * scale.gyro, walk * scale.accelerometer};
  }
  // Sets the scale factors of the sensors; each is given less 1.
  void set_scale_factors(const Vector3& gyro, const Vector3& accelerometer) { scale_ << gyro, accelerometer; }

  void step() {
    const double t = dt * static_cast<double>(k_++);
    const Vector3 rocking(0.3 * std::sin(0.9 * t), 0.2 * std::cos(0.7 * t), 0.25 * std::sin(0.31 * t));
    const Vector3 rate = spin_ == 0 ? rocking : Vector3(0, 0, spin_);
    const Vector3 acceleration_N(2 * std::sin(0.5 * t), 2 * std::cos(0.4 * t), std::sin(0.8 * t));
    const Vector3 force_P = truth_.state().q_NP.conjugate() * Vector3(acceleration_N - Vector3(0, 0, g));
    truth_.advance(dt * rate, dt * force_P, dt);
    gyro_bias_ += draw(random_, noise_.gyro_walk * std::sqrt(dt));
    accelerometer_bias_ += draw(random_, noise_.accelerometer_walk * std::sqrt(dt));
    if (scale_walk_.gyro > 0) {
      scale_.head<3>() += draw(random_, scale_walk_.gyro);
      scale_.tail<3>() += draw(random_, scale_walk_.accelerometer);
    }
    const Vector3 rate_error = gyro_bias_ + scale_.head<3>().cwiseProduct(rate),
                  force_error = accelerometer_bias_ + scale_.tail<3>().cwiseProduct(force_P);
    filter_.advance(dt * (rate + rate_error) + draw(random_, noise_.gyro * std::sqrt(dt)),
                    dt * (force_P + force_error) + draw(random_, noise_.accelerometer * std::sqrt(dt)), dt);
    if (has_aids_ && k_ % 10 == 0) {
      aid(Filter::position, truth_.state().r_N - filter_.motion().r_N, 1.5);
      aid(Filter::velocity, truth_.state().v_N - filter_.motion().v_N, 0.1);
    }
  }

  // Returns the errors of the 15 states, and after them the errors of the scale factors.
  Eigen::Matrix<double, 21, 1> errors() const {
    Eigen::Matrix<double, 21, 1> error;
    error << log(truth_.state().q_NP * filter_.motion().q_NP.conjugate()), truth_.state().v_N - filter_.motion().v_N,
        truth_.state().r_N - filter_.motion().r_N, gyro_bias_ - filter_.gyro_bias_P(),
        accelerometer_bias_ - filter_.accelerometer_bias_P(), scale_ - filter_.added().estimates.head<6>();
    return error;
  }
  Eigen::Matrix<double, 21, 21> covariance_of_21() const {
    Eigen::Matrix<double, 21, 21> P;
    P << filter_.covariance(), filter_.added().cross_covariance.leftCols<6>(),
        filter_.added().cross_covariance.leftCols<6>().transpose(), filter_.added().covariance.topLeftCorner<6, 6>();
    return P;
  }
  // Returns the square of the error of all states in units of its covariance.
  double nees() const {
    const Filter::State error = errors().head<15>();
    return error.dot(filter_.covariance().llt().solve(error));
  }
  double nees_of_21() const { return errors().dot(covariance_of_21().llt().solve(errors())); }
  Filter& filter() { return filter_; }
  // Sets the rotation about down, with an error of `sigma`.
  void set_heading(double sigma) {
    const Vector3 error = log(truth_.state().q_NP * filter_.motion().q_NP.conjugate());
    filter_.turn(Vector3::UnitZ(), error.z() + draw(random_, sigma).x(), sigma * sigma);
  }
  void set_aids(bool has_aids) { has_aids_ = has_aids; }
  // Turns about z alone, rad/s.
  void set_spin(double rate) { spin_ = rate; }

 private:
  void aid(int first, const Vector3& difference, double sigma) {
    filter_.propagate();
    filter_.update({.first = first,
                    .innovation = difference + draw(random_, sigma),
                    .variance = Vector3::Constant(sigma * sigma)});
  }

  std::mt19937_64 random_;
  InertialNoise noise_;
  bool has_aids_;
  Strapdown truth_{flat_earth};
  Filter filter_;
  double spin_ = 0;
  Vector3 gyro_bias_, accelerometer_bias_;
  Eigen::Matrix<double, 6, 1> scale_;
  Filter::ScaleSigmas scale_walk_;
  std::uint64_t k_ = 0;
};

// Mean over 40 flights at five instants, 20 s apart.
double mean_nees(const InertialNoise& noise, bool has_aids) {
  double sum = 0;
  int count = 0;
  for (unsigned seed = 1; seed <= 40; ++seed) {
    Flight flight(seed, noise, has_aids);
    for (int k = 1; k <= 5000; ++k) {
      flight.step();
      if (k % 1000 != 0) continue;
      sum += flight.nees();
      ++count;
    }
  }
  EXPECT_EQ(count, 200);
  return sum / count;
}

// The sum of 200 squares of 15 degrees of freedom has a standard deviation of sqrt(2 x 15 x 200): the mean is within
// 15 +- 1.9 with a probability of false alarm of 1e-6, were all independent.
TEST(InertialFilter, IsConsistentWithFixes) { EXPECT_NEAR(mean_nees(mems, true), 15, 1.9); }
TEST(InertialFilter, IsConsistentWithoutAids) {
  // Without aids the errors of the five instants are one draw each flight: sqrt(5) times the deviation.
  EXPECT_NEAR(mean_nees(mems, false), 15, 1.9 * std::sqrt(5.0));
}
TEST(InertialFilter, NoisierSensorsShow) {
  EXPECT_GT(mean_nees({4 * mems.gyro, 4 * mems.accelerometer, 4 * mems.gyro_walk, 4 * mems.accelerometer_walk}, true),
            20);
}

// A heading that is set in flight: the other states keep what they know.
TEST(InertialFilter, IsConsistentAfterASetHeading) {
  double sum = 0;
  constexpr unsigned flights = 200;
  for (unsigned seed = 1; seed <= flights; ++seed) {
    Flight flight(seed, mems, true);
    for (int k = 1; k <= 1000; ++k) flight.step();
    flight.set_heading(0.05);
    sum += flight.nees();
    for (int k = 1; k <= 100; ++k) flight.step();
    sum += flight.nees();
  }
  EXPECT_NEAR(sum / (2 * flights), 15, 1.9);
}

// The same of 21 states. The five epochs of a flight are correlated: the bound is between 2.2 standard deviations of
// the mean, sqrt(2 x 21/15), and 4.9, sqrt(2 x 21/75). The seeds are fixed, so that only other arithmetic draws
// again.
constexpr Filter::ScaleSigmas half_a_percent = {5e-3, 5e-3};
TEST(InertialFilter, IsConsistentWithScaleFactors) {
  double sum = 0;
  for (unsigned seed = 1; seed <= 15; ++seed) {
    Flight flight(seed, mems, true, half_a_percent);
    for (int k = 1; k <= 5000; ++k) {
      flight.step();
      if (k % 1000 == 0) sum += flight.nees_of_21();
    }
  }
  EXPECT_NEAR(sum / 75, 21, 3.7);
}

// Without aids the covariance is the one of the errors' growth alone, of which each flight is one draw: the bound
// is 4.9 standard deviations of the mean, sqrt(2 x 21/60).
TEST(InertialFilter, IsConsistentWithScaleFactorsWithoutAids) {
  double sum = 0;
  for (unsigned seed = 1; seed <= 60; ++seed) {
    Flight flight(seed, mems, false, {1e-4, 1e-4});
    for (int k = 1; k <= 1000; ++k) flight.step();
    flight.filter().propagate();
    sum += flight.nees_of_21();
  }
  EXPECT_NEAR(sum / 60, 21, 4.1);
}

// A quarter of a turn about down: the uncertainty of the tilt stays with the platform, and nothing is correlated with
// the heading.
TEST(InertialFilter, ATurnTakesTheTiltAlong) {
  Flight flight(1, mems, true);
  for (int k = 1; k <= 1000; ++k) flight.step();
  Filter& filter = flight.filter();
  filter.propagate();
  const Filter::Covariance before = filter.covariance();
  const Quaternion q_NP = filter.motion().q_NP;
  filter.turn(Vector3::UnitZ(), units::pi / 2, 0.01);
  const Filter::Covariance& P = filter.covariance();
  EXPECT_LT(filter.motion().q_NP.angularDistance(exp(Vector3(0, 0, units::pi / 2)) * q_NP), 1e-12);
  EXPECT_NEAR(P(0, 0), before(1, 1), 1e-9 * before(1, 1));
  EXPECT_NEAR(P(1, 1), before(0, 0), 1e-9 * before(0, 0));
  EXPECT_NEAR(P(0, 3), -before(1, 3), 1e-9 * std::abs(before(1, 3)));
  EXPECT_NEAR(P(1, 3), before(0, 3), 1e-9 * std::abs(before(0, 3)));
  EXPECT_NEAR(P(2, 2), 0.01, 1e-12);
  EXPECT_LT(P.row(2).head(2).norm() + P.row(2).tail(12).norm(), 1e-15);
  EXPECT_TRUE((P.array() == P.transpose().array()).all());
  EXPECT_EQ(P.llt().info(), Eigen::Success);
  EXPECT_EQ((P.block<12, 12>(3, 3)), (before.block<12, 12>(3, 3)));
}

// Rounding leaves the covariance symmetric to the last bit, and positive definite.
TEST(InertialFilter, CovarianceStaysDefinite) {
  Flight flight(1, mems, true);
  for (int round = 0; round < 20; ++round) {
    flight.set_aids(round % 3 != 1);  // with outages of 100 s
    for (int k = 0; k < 5000; ++k) flight.step();
    const Filter::Covariance& P = flight.filter().covariance();
    ASSERT_TRUE((P.array() == P.transpose().array()).all());
    ASSERT_EQ(P.llt().info(), Eigen::Success);
    ASSERT_GT(P.diagonal().minCoeff(), 0);
  }
}

// Turns to the right and to the left, with fixes; then turns to the right alone, without. A scale factor that is off
// by 500 ppm turns the heading by 0.05 rad in the last 100 rad, and the filter of 15 states knows nothing of it.
TEST(InertialFilter, FindsScaleFactors) {
  constexpr double ppm = 1e-6;
  double found2 = 0, with2 = 0, without2 = 0;
  constexpr unsigned flights = 3;
  for (unsigned seed = 1; seed <= flights; ++seed)
    for (const bool estimates : {false, true}) {
      InertialNoise tuning = mems;
      tuning.gyro_scale = tuning.accelerometer_scale = 500 * ppm;
      Flight flight(seed, mems, true, estimates ? Filter::ScaleSigmas{500 * ppm, 500 * ppm} : Filter::ScaleSigmas{},
                    tuning);
      flight.set_scale_factors(Vector3(-500, 500, 500) * ppm, Vector3(500, -500, 500) * ppm);
      const auto turn = [&](double rate, double seconds) {
        flight.set_spin(rate);
        for (int k = 0; k < static_cast<int>(seconds / dt); ++k) flight.step();
      };
      for (const double rate : {1.0, -1.0, 1.0, -1.0, 1.0, -1.0}) turn(rate, 40);
      flight.set_aids(false);
      turn(1, 100);
      const double heading2 = square(flight.errors()[2]);
      (estimates ? with2 : without2) += heading2 / flights;
      if (estimates) found2 += square(flight.errors()[17]) / flights;
    }
  EXPECT_LT(std::sqrt(found2), 60 * ppm);
  EXPECT_GT(std::sqrt(without2), 0.03);
  EXPECT_LT(std::sqrt(with2), 0.25 * std::sqrt(without2));
}

TEST(InertialFilter, CovarianceOfScaleFactorsStaysDefinite) {
  Flight flight(1, mems, true, half_a_percent);
  for (int round = 0; round < 4; ++round) {
    flight.set_aids(round % 3 != 1);
    for (int k = 0; k < 5000; ++k) flight.step();
    const auto P = flight.covariance_of_21();
    ASSERT_TRUE((P.array() == P.transpose().array()).all());
    ASSERT_EQ(P.llt().info(), Eigen::Success);
  }
  // A scale factor that is forgotten leaves no trace, and begins again at its first variance.
  Filter& filter = flight.filter();
  filter.estimate_scale_factors({0, half_a_percent.accelerometer});
  EXPECT_TRUE(filter.added().estimates.head<3>().isZero(0.0) && !filter.added().estimates.segment<3>(3).isZero(0.0));
  filter.estimate_scale_factors({});
  EXPECT_TRUE(filter.added().estimates.isZero(0.0) && filter.added().cross_covariance.isZero(0.0) &&
              filter.added().covariance.isZero(0.0));
  filter.estimate_scale_factors(half_a_percent);
  EXPECT_DOUBLE_EQ(filter.added().covariance(0, 0), 25e-6);
  EXPECT_DOUBLE_EQ(filter.added().covariance(5, 5), 25e-6);
}

// Errors of scale make a noise of a turn, and of an acceleration; none at rest.
TEST(InertialFilter, ScaleErrorsAreNoiseInManoeuvres) {
  const InertialNoise noise = {.gyro_scale = 1e-3, .accelerometer_scale = 2e-3, .g_sensitivity = 1e-5};
  const auto variances = [&](double rate, double acceleration) {  // about z, along z, after a second
    Filter filter(flat_earth, {}, noise);
    filter.begin({}, Vector3::Zero(), Vector3::Zero(), Filter::Covariance::Zero());
    for (int k = 0; k < 50; ++k) filter.advance({0, 0, dt * rate}, {0, 0, dt * (acceleration - g)}, dt);
    return Vector2(filter.covariance()(2, 2), filter.covariance()(5, 5));
  };
  EXPECT_LT(variances(0, 0).norm(), 1e-20);
  EXPECT_NEAR(variances(0.5, 0).x(), InertialNoise::manoeuvre_s * 1e-6 * 0.25, 1e-12);
  EXPECT_NEAR(variances(0, 3).x(), InertialNoise::manoeuvre_s * 1e-10 * 9, 1e-14);
  EXPECT_NEAR(variances(0, 3).y(), InertialNoise::manoeuvre_s * 4e-6 * 9, 1e-10);
}

// A row of a measurement: with the variance p before and r of the measurement, p r/(p + r) and p/(p + r) of the
// innovation.
TEST(InertialFilter, UpdatesAsScalarsDo) {
  Filter filter(flat_earth, {}, mems);
  const Filter::State variance = first_sigma().cwiseProduct(first_sigma());
  filter.begin({}, Vector3::Zero(), Vector3::Zero(), variance.asDiagonal());
  const Filter::Measurement position = {
      .first = Filter::position, .innovation = {1, 2, 3}, .variance = Vector3(4, 1, 9)};
  EXPECT_NEAR(filter.normalized_square(position), 1.0 / 8 + 4.0 / 5 + 9.0 / 18, 1e-12);
  filter.update(position);
  EXPECT_LT((filter.motion().r_N - Vector3(0.5, 1.6, 1.5)).norm(), 1e-12);
  EXPECT_LT((filter.covariance().diagonal().segment<3>(Filter::position) - Vector3(2, 0.8, 4.5)).norm(), 1e-12);
}

// With the variances p of the position, d of the aid's error and r of its noise: p/(p + d + r) of the innovation is
// the position's, and d/(p + d + r) the error's.
TEST(InertialFilter, EstimatesTheErrorOfAnAid) {
  const Filter::AidError error = Filter::AidError::walk(3, 0);
  Filter filter(flat_earth, {}, mems, {&error, 1});
  Filter::Covariance P = Filter::Covariance::Zero();
  P.diagonal().segment<3>(Filter::position).setConstant(4);
  filter.begin({}, Vector3::Zero(), Vector3::Zero(), P);
  const Filter::Measurement down = {
      .first = Filter::position,
      .rows = 1,
      .axes_N = Vector3::UnitZ() * Vector3::UnitX().transpose() + Vector3::UnitX() * Vector3::UnitZ().transpose(),
      .innovation = {7, 0, 0},
      .variance = Vector3::Ones(),
      .error = 0};
  EXPECT_NEAR(filter.normalized_square(down), 49.0 / 14, 1e-12);
  filter.update(down);
  EXPECT_LT((filter.motion().r_N - Vector3(0, 0, 2)).norm(), 1e-12);
  EXPECT_NEAR(filter.added().estimates[0], 4.5, 1e-12);
  EXPECT_NEAR(filter.covariance()(8, 8), 4 - 16.0 / 14, 1e-12);
  EXPECT_NEAR(filter.added().covariance(0, 0), 9 - 81.0 / 14, 1e-12);
  EXPECT_NEAR(filter.added().cross_covariance(8, 0), -36.0 / 14, 1e-12);
  // Of the 7 m the state explains 2, and the error of the aid 4.5: 0.5 are left.
  Filter::Measurement again = down;
  again.innovation[0] = 5;
  EXPECT_NEAR(filter.normalized_square(again), 0.25 / (1 + 13.0 / 14), 1e-12);
}

// A filter that begins at a fix has its error: the next fix, with the same error, differs by the noise of both.
TEST(InertialFilter, BeginsWithTheErrorOfAnAid) {
  const std::vector<Filter::AidError> errors(3, Filter::AidError::walk(3, 0));
  Filter filter(flat_earth, {}, mems, errors);
  Filter::Covariance P = Filter::Covariance::Zero();
  P.diagonal().segment<3>(Filter::position).setConstant(9 + 1);
  filter.begin({}, Vector3::Zero(), Vector3::Zero(), P);
  const Matrix3 axes = exp(Vector3(0.1, 0.2, 0.3)).toRotationMatrix();
  filter.begin_by(Filter::position, axes, 0);
  const Filter::Measurement fix = {
      .first = Filter::position, .axes_N = axes, .innovation = {1, 2, 3}, .variance = Vector3::Ones(), .error = 0};
  EXPECT_NEAR(filter.normalized_square(fix), 14.0 / 2, 1e-12);
}

// A correlated error keeps its variance, and its estimate decays; a random walk grows.
TEST(InertialFilter, TheErrorsOfAidsHaveTheirTimes) {
  const std::vector<Filter::AidError> errors = {Filter::AidError::correlated(2, 10), Filter::AidError::walk(1, 0.5)};
  Filter filter(flat_earth, {}, mems, errors);
  Filter::Covariance P = Filter::Covariance::Zero();
  P.diagonal().segment<3>(Filter::position).setConstant(1e-6);
  filter.begin({}, Vector3::Zero(), Vector3::Zero(), P);
  filter.update(
      {.first = Filter::position, .rows = 1, .innovation = {5, 0, 0}, .variance = {1e-6, 1, 1}, .error = 0});
  EXPECT_NEAR(filter.added().estimates[0], 5, 1e-4);
  for (int k = 0; k < 500; ++k) filter.advance(Vector3::Zero(), {0, 0, -dt * g}, dt);
  EXPECT_NEAR(filter.added().estimates[0], 5 * std::exp(-1), 1e-4);
  EXPECT_NEAR(filter.added().covariance(0, 0), 4 * (1 - std::exp(-2)), 1e-4);
  EXPECT_NEAR(filter.added().covariance(1, 1), 1 + 0.25 * 10, 1e-9);
}

}  // namespace
}  // namespace imud
