#include "core/navigation/attitude_filter.hpp"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <cmath>
#include <complex>
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
      // Drawn one after the other: compilers differ in the order in which they evaluate arguments.
      const Vector3 of_accelerometer = drawn(random, noise.accelerometer * std::sqrt(ahrs_dt));
      const Vector3 of_gyro = drawn(random, noise.gyro * std::sqrt(ahrs_dt));
      filter.advance(turn + ahrs_dt * gyro_bias + of_gyro, ahrs_dt * force_P + of_accelerometer, ahrs_dt);
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

// Both filters, of 6 states and of one complex tilt with its bias, in a straight flight and then a level turn.
struct Turning {
  double speed, rate;  // m/s, rad/s
};

// The tilt of the solution in the turn, rad: a filter of one complex number for the tilt about ahead and right and
// one for the bias of both gyros, in axes that turn with the heading. With the rate w, the apparent vertical leans by
// atan(v w/g) to the centre.
//   d tilt = -i w tilt - bias - k1 (tilt + lean)    d bias = -k2 (tilt + lean)    dP = A P + P A^H + Q - k r k^H
class ComplexTilt {
 public:
  explicit ComplexTilt(const AttitudeTuning& tuning, double tilt, double bias)
      : tuning_(tuning), p11_(tilt * tilt), p22_(bias * bias) {}
  void advance(double seconds, const Turning& turn) {
    using Complex = std::complex<double>;
    const double by_rate = AttitudeFilter::turning_speed * turn.rate, n = tuning_.noise.accelerometer;
    const double r =
        (2 * AttitudeFilter::acceleration_s * (std::pow(tuning_.acceleration, 2) + by_rate * by_rate) + n * n) /
        (ahrs_g * ahrs_g);
    const double lean = std::atan(turn.speed * turn.rate / ahrs_g);
    const Complex iw(0, turn.rate);
    constexpr double h = 1e-3;
    for (double t = 0; t < seconds; t += h) {
      const double k1 = p11_ / r;
      const Complex k2 = std::conj(p12_) / r;
      const Complex tilt = tilt_ + h * (-iw * tilt_ - bias_ - k1 * (tilt_ - lean));
      bias_ += h * (-k2 * (tilt_ - lean));
      tilt_ = tilt;
      const double p11 = p11_ + h * (-2 * p12_.real() + std::pow(tuning_.noise.gyro, 2) - k1 * p11_);
      const Complex p12 = p12_ + h * (-iw * p12_ - p22_ - k1 * p12_);
      p22_ += h * (std::pow(tuning_.noise.gyro_walk, 2) - std::norm(p12_) / r);
      p11_ = p11;
      p12_ = p12;
    }
  }
  double tilt() const { return std::abs(tilt_); }
  double gain() const { return p11_; }

 private:
  AttitudeTuning tuning_;
  std::complex<double> tilt_ = 0, bias_ = 0, p12_ = 0;
  double p11_, p22_;
};

class LevelTurn {
 public:
  LevelTurn(const AttitudeTuning& tuning, double tilt, double bias) : filter_({}, tuning) {
    filter_.begin(Quaternion::Identity(), first_covariance(tilt, 0.01, bias));
  }
  void advance(double seconds, const Turning& turn) {
    const double bank = std::atan(turn.speed * turn.rate / ahrs_g);
    const Quaternion roll = exp(Vector3(bank, 0, 0));
    // The bank comes with the turn.
    if (bank != bank_) filter_.advance({bank - bank_, 0, 0}, {0, 0, -ahrs_dt * ahrs_g}, ahrs_dt);
    bank_ = bank;
    for (double t = 0; t < seconds - 0.5 * ahrs_dt; t += ahrs_dt) {
      heading_ += turn.rate * ahrs_dt;
      filter_.advance(roll.conjugate() * Vector3(0, 0, turn.rate * ahrs_dt),
                      {0, 0, -ahrs_dt * ahrs_g / std::cos(bank)}, ahrs_dt);
      // An exact compass, so that the tilt alone is in question.
      const double error = log(q_LP() * filter_.q_LP().conjugate()).z();
      filter_.update({.innovation = error, .variance = 1e-8});
    }
  }
  double tilt() const { return log(q_LP() * filter_.q_LP().conjugate()).head<2>().norm(); }

 private:
  Quaternion q_LP() const { return exp(Vector3(0, 0, heading_)) * exp(Vector3(bank_, 0, 0)); }

  AttitudeFilter filter_;
  double bank_ = 0, heading_ = 0;
};

// In a long coordinated turn the specific force stands along the platform's z axis, and the solution leans to it.
TEST(AttitudeFilter, LeansInATurnAsTheoryHasIt) {
  for (const Turning& turn : {Turning{10, 0.1}, Turning{30, 0.05}, Turning{15, -0.05}}) {
    ComplexTilt theory(quiet_tuning(), 0.02, 1e-3);
    LevelTurn solution(quiet_tuning(), 0.02, 1e-3);
    theory.advance(300, {0, 0});
    solution.advance(300, {0, 0});
    EXPECT_NEAR(solution.tilt(), 0, 1e-9);
    const double lean = std::abs(std::atan(turn.speed * turn.rate / ahrs_g));
    double last = 0;
    for (const double seconds : {5.0, 25.0, 30.0, 60.0, 180.0}) {
      theory.advance(seconds, turn);
      solution.advance(seconds, turn);
      EXPECT_NEAR(solution.tilt(), theory.tilt(), 0.06 * theory.tilt() + 1e-4) << turn.speed << ' ' << seconds;
      last = solution.tilt();
    }
    // Quick circles are averaged; in slow ones the bias takes up the rest of the lean as well.
    EXPECT_GT(last, (std::abs(turn.rate) > 0.07 ? 0.03 : 0.6) * lean);
    EXPECT_LT(last, lean);
  }
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

// Within a period, with a tilt and an acceleration: the heading turns, and the rest of the period is levelled as
// before.
TEST(AttitudeFilter, TurnsWithItsTilt) {
  const Quaternion q_LP = exp(Vector3(0.2, -0.1, 0)) * exp(Vector3(0, 0, 1));
  const auto level_of = [](const AttitudeFilter& filter) {
    return Vector3(filter.q_LP().conjugate() * Vector3::UnitZ());
  };
  AttitudeFilter turned({}, quiet_tuning()), straight({}, quiet_tuning());
  for (AttitudeFilter* filter : {&turned, &straight}) {
    AttitudeFilter::Covariance P = first_covariance(0.05, 0.1, 1e-3);
    P(0, 0) *= 4;
    filter->begin(exp(Vector3(0.03, 0, 0)) * q_LP, P);
    for (int k = 0; k < 50; ++k) {
      if (k == 25 && filter == &turned) filter->turn(2, 0.01);
      filter->advance({1e-3, 2e-3, 0}, 0.008 * (q_LP.conjugate() * Vector3(0.3, 0.2, -ahrs_g)), 0.008);
    }
  }
  EXPECT_LT((level_of(turned) - level_of(straight)).norm(), 1e-9);
  EXPECT_NEAR(turned.q_LP().angularDistance(straight.q_LP()), 2, 0.01);
  EXPECT_NEAR(turned.covariance()(2, 2), 0.01, 1e-4);
  EXPECT_LT(std::abs(turned.covariance()(2, 0)), 1e-5);
  const auto tilt_variance = [](const AttitudeFilter& filter) {
    return filter.covariance().diagonal().head(2).sum();
  };
  EXPECT_NEAR(tilt_variance(turned), tilt_variance(straight), 1e-6);
}

// Without levelling, an acceleration does not tilt the attitude.
TEST(AttitudeFilter, LevelsUnlessItMustNot) {
  for (const bool levels : {true, false}) {
    AttitudeFilter filter({}, quiet_tuning());
    filter.begin(Quaternion::Identity(), first_covariance(0.01, 0.1, 1e-4));
    filter.set_levelling(levels);
    for (int k = 0; k < 500; ++k) filter.advance(Vector3::Zero(), ahrs_dt * Vector3(0.5, 0, -ahrs_g), ahrs_dt);
    const double tilt = filter.q_LP().angularDistance(Quaternion::Identity());
    EXPECT_EQ(tilt > 0.02, levels) << tilt;
    EXPECT_EQ(tilt < 1e-9, !levels) << tilt;
  }
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
