// The errors drawn for each unit, and at each power on: the distribution of every element over many seeds, and what
// of it a sensor shows.
#include "core/effects/drawn_errors.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <boost/math/distributions/chi_squared.hpp>
#include <boost/math/distributions/normal.hpp>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "core/attitude.hpp"
#include "core/imu.hpp"

namespace imud {
namespace {

// Every element has a standard deviation of its own.
ConstantErrors sigmas() {
  ConstantErrors all;
  double next = 1;
  const auto fill = [&](auto& term) {
    for (int i = 0; i < term.size(); ++i) term.data()[i] = 1e-3 * next++;
  };
  for_each_constant(fill, all);
  all.misalignment.diagonal().setZero();
  return all;
}

// The elements that have a standard deviation.
std::vector<double> elements(const ConstantErrors& all) {
  std::vector<double> list;
  const auto append = [&](const auto& term) { list.insert(list.end(), term.data(), term.data() + term.size()); };
  append(all.bias);
  append(all.scale_factor);
  append(all.scale_factor_asymmetry);
  append(all.quadratic);
  append(all.cubic);
  append(all.misalignment);
  append(all.g_sensitivity);
  append(all.temperature_scale);
  append(all.temperature_bias);
  append(all.temperature_rate_bias);
  append(all.temperature_hysteresis);
  append(all.cross_sensitivity);
  append(all.vibration_rectification);
  const Matrix3& m = all.misalignment;
  EXPECT_EQ(m.diagonal(), Vector3::Zero());
  for (const std::size_t diagonal : {23U, 19U, 15U}) list.erase(list.begin() + static_cast<std::ptrdiff_t>(diagonal));
  return list;
}

constexpr std::size_t seeds = 4000, per_layer = 72;
using Series = std::vector<double>;  // of one element, in units of its standard deviation, by seed

// The series of the elements of both layers, for two imus and two quantities and the first two power ons:
// 72 * (2 + 2 + 2 + 1 + 1) of them.
const std::vector<Series>& series() {
  static const std::vector<Series> all = [] {
    TriadErrors errors;
    errors.unit_sigma = errors.turn_on_sigma = sigmas();
    const std::vector<double> sigma = elements(sigmas());
    EXPECT_EQ(sigma.size(), per_layer);
    std::vector<Series> made;
    for (std::uint64_t seed = 1; seed <= seeds; ++seed) {
      std::vector<double> values;
      const auto append = [&](const ConstantErrors& drawn) {
        const std::vector<double> list = elements(drawn);
        for (std::size_t i = 0; i < list.size(); ++i) values.push_back(list[i] / sigma[i]);
      };
      for (const char* imu : {"imu1", "imu2"}) {
        const Normals normals(seed, stream_id(imu));
        append(drawn_for_unit(errors, Quantity::rate, normals));
        append(drawn_at_power_on(errors, Quantity::rate, normals, 0));
        append(drawn_at_power_on(errors, Quantity::rate, normals, 1));
      }
      const Normals normals(seed, stream_id("imu1"));
      append(drawn_for_unit(errors, Quantity::specific_force, normals));
      append(drawn_at_power_on(errors, Quantity::specific_force, normals, 0));
      made.resize(values.size());
      for (std::size_t i = 0; i < values.size(); ++i) made[i].push_back(values[i]);
    }
    return made;
  }();
  return all;
}

double mean(const Series& z) {
  double sum = 0;
  for (const double value : z) sum += value;
  return sum / static_cast<double>(z.size());
}

TEST(DrawnErrors, HaveANameForEachMember) {
  ConstantErrors all;
  std::size_t members = 0, size = 0;
  for_each_constant(
      [&](const auto& member) {
        ++members;
        size += sizeof member;
      },
      all);
  EXPECT_EQ(size, sizeof all) << "for_each_constant() leaves a member out";
  EXPECT_EQ(members, constant_error_names.size());
}

// 576 elements and three tests of each with a false alarm of 1e-7: 1.7e-4 in all.
TEST(DrawnErrors, EachElementIsNormalWithItsStandardDeviation) {
  constexpr double false_alarm = 1e-7;
  const double n = seeds, bound = boost::math::quantile(complement(boost::math::normal(), 0.5 * false_alarm));
  const boost::math::chi_squared chi(n - 1);
  const double least = quantile(chi, 0.5 * false_alarm), most = quantile(complement(chi, 0.5 * false_alarm));
  // Kolmogorov's distribution: P(sqrt(n) D > x) = 2 exp(-2 x^2) for a small probability.
  const double distance = std::sqrt(-0.5 * std::log(0.5 * false_alarm) / n);
  ASSERT_EQ(series().size(), 8 * per_layer);
  const boost::math::normal normal;
  for (std::size_t i = 0; i < series().size(); ++i) {
    Series z = series()[i];
    const double m = mean(z);
    EXPECT_LT(std::abs(m), bound / std::sqrt(n)) << i;
    double sum = 0;
    for (const double value : z) sum += (value - m) * (value - m);
    EXPECT_TRUE(sum > least && sum < most) << i << " " << sum / n;
    std::ranges::sort(z);
    double worst = 0;
    for (std::size_t k = 0; k < z.size(); ++k) {
      const double p = cdf(normal, z[k]), before = static_cast<double>(k) / n;
      worst = std::max({worst, p - before, before + 1 / n - p});
    }
    EXPECT_LT(worst, distance) << i;
  }
  // The tests find a standard deviation that is off by 10 %, and a uniform distribution.
  EXPECT_FALSE(1.21 * (n - 1) < most);
  EXPECT_GT(0.057, distance) << "the greatest distance of the uniform distribution of the same variance";
}

// Elements, axes, imus, quantities, layers and power ons, and successive seeds: 165600 pairs at one seed and 576 from
// one seed to the next, each with a false alarm of 1e-9, 1.7e-4 in all.
TEST(DrawnErrors, AreIndependent) {
  const double bound = boost::math::quantile(complement(boost::math::normal(), 0.5e-9)) / std::sqrt(double{seeds});
  EXPECT_LT(bound, 0.1) << "a correlation of 0.2 would be found";
  std::size_t pairs = 0;
  const auto correlation = [](const Series& a, const Series& b, std::size_t lag) {
    double sum = 0;
    for (std::size_t k = 0; k + lag < a.size(); ++k) sum += a[k] * b[k + lag];
    return sum / static_cast<double>(a.size() - lag);
  };
  for (std::size_t i = 0; i < series().size(); ++i) {
    EXPECT_LT(std::abs(correlation(series()[i], series()[i], 1)), bound) << i;
    for (std::size_t j = 0; j < i; ++j, ++pairs)
      EXPECT_LT(std::abs(correlation(series()[i], series()[j], 0)), bound) << i << " " << j;
  }
  EXPECT_EQ(pairs, 165600U);
}

// A sensor that turns and is accelerated, at 35 degrees Celsius.
ImuModel model() {
  ImuModel model;
  model.temperature_c = 35;
  for (TriadErrors* errors : {&model.gyro, &model.accelerometer}) {
    errors->bias = {0.1, 0.2, 0.3};
    errors->unit_sigma = errors->turn_on_sigma = sigmas();
    errors->turn_on_sigma.bias.setZero();
  }
  return model;
}

class Turning {
 public:
  Turning() {
    for (std::int64_t ms = 0; ms <= 1000; ms += 10) {
      Truth truth;
      truth.time = TruthTime{} + std::chrono::milliseconds(ms);
      truth.q_NB = exp(1e-3 * static_cast<double>(ms) * rate);
      truth.omega_BN_B = rate;
      truth.has_specific_force = true;
      truth.specific_force_B = force;
      timeline_.push(truth);
    }
  }
  Sample next(Imu& imu) {
    const TruthTime now = TruthTime{} + std::chrono::milliseconds(10 * k_++);
    return imu.sample(timeline_, now, DeviceTime{now.ns});
  }
  const Vector3 rate = {0.5, -0.25, 1}, force = {1, 2, -9};

 private:
  Timeline timeline_;
  std::int64_t k_ = 0;
};

// By hand, in the order of core/README.md.
Vector3 measured(const TriadErrors& nominal, const ConstantErrors& unit, const ConstantErrors& turn_on,
                 const Vector3& input, const Vector3& force, const Vector3& bias) {
  const double x = 35 - nominal.reference_temperature_c;
  const Vector3 powers(x, x * x, x * x * x);
  Vector3 m = input + (unit.misalignment + turn_on.misalignment) * input;
  m = (nominal.scale_factor + unit.scale_factor + turn_on.scale_factor).cwiseProduct(m);
  const Vector3 square = m.cwiseProduct(m);
  m += 0.5 * (unit.scale_factor_asymmetry + turn_on.scale_factor_asymmetry).cwiseProduct(m.cwiseAbs()) +
       (unit.quadratic + turn_on.quadratic).cwiseProduct(square) +
       (unit.cubic + turn_on.cubic).cwiseProduct(square.cwiseProduct(m));
  m += ((unit.temperature_scale + turn_on.temperature_scale) * powers).cwiseProduct(m);
  return m + bias + unit.bias + (unit.temperature_bias + turn_on.temperature_bias) * powers +
         (unit.g_sensitivity + turn_on.g_sensitivity) * force +
         (unit.cross_sensitivity + turn_on.cross_sensitivity) *
             Vector3(force.y() * force.z(), force.z() * force.x(), force.x() * force.y());
}

TEST(DrawnErrors, AreWhatTheSensorShowsUntilTheNextPowerOn) {
  constexpr std::uint64_t seed = 7;
  const ImuModel made = model();
  const Normals normals(seed, stream_id("imu1"));
  Turning turning;
  Imu imu(made, seed, stream_id("imu1"));
  Vector3 bias = made.gyro.bias;
  const auto compare = [&](Sample sample, std::uint64_t number, const Normals& of_power_on, const std::string& what) {
    for (const auto& [errors, quantity, input, seen] :
         {std::tuple{made.gyro, Quantity::rate, turning.rate, sample.rate},
          std::tuple{made.accelerometer, Quantity::specific_force, turning.force, sample.specific_force}}) {
      const Vector3 expected = measured(errors, drawn_for_unit(errors, quantity, normals),
                                        drawn_at_power_on(errors, quantity, of_power_on, number), input,
                                        turning.force, quantity == Quantity::rate ? bias : errors.bias);
      EXPECT_LT((seen - expected).cwiseAbs().maxCoeff(), 1e-9 * expected.cwiseAbs().maxCoeff()) << what;
    }
  };
  compare(turning.next(imu), 0, normals, "as delivered");
  compare(turning.next(imu), 0, normals, "constant");
  imu.power_on(1);
  compare(turning.next(imu), 1, normals, "another power on");
  bias = {-1, 0, 1};
  imu.set_bias(Quantity::rate, bias);
  compare(turning.next(imu), 1, normals, "another bias leaves what was drawn");
  // Another seed leaves the unit as it is, and draws the next power on.
  imu.set_seed(8);
  compare(turning.next(imu), 1, normals, "another seed");
  Imu early(made, seed, stream_id("imu1"));
  early.continue_from(imu);
  early.set_bias(Quantity::rate, bias);
  compare(Turning(turning).next(early), 1, normals, "reloaded with another seed");
  imu.power_on(2);
  const Normals others(8, stream_id("imu1"));
  compare(turning.next(imu), 2, others, "another power on of another seed");
  // A reload goes on with the same unit.
  Imu reloaded(made, seed, stream_id("imu1"));
  reloaded.continue_from(imu);
  bias = made.gyro.bias;
  compare(turning.next(reloaded), 2, others, "reloaded");
}

// Errors whose effects have a history: another power on draws their coefficients, and leaves the history.
TEST(DrawnErrors, OfAHistoryAreDrawnAgainWithoutIt) {
  ImuModel made;
  made.rate_hz = 100;
  made.temperature.profile_s = {0, 10};
  made.temperature.profile_c = {20, 30};
  made.vibration.sines = {{.frequency_hz = 100, .force = {0, 0, 2}}};  // 0 at each sample, mean square 2
  ConstantErrors& sigma = made.gyro.unit_sigma;
  sigma.temperature_rate_bias = {1, 2, 3};
  sigma.temperature_hysteresis = {4, 5, 6};
  sigma.vibration_rectification = Matrix3::Constant(7);
  made.gyro.temperature_hysteresis_c = 1;
  made.gyro.turn_on_sigma = sigma;
  const Normals normals(3, stream_id("imu1"));
  Turning turning;
  Imu imu(made, 3, stream_id("imu1"));
  const auto expect = [&](const Vector3& error, std::uint64_t number, double degrees_per_s, double play) {
    const ConstantErrors unit = drawn_for_unit(made.gyro, Quantity::rate, normals);
    const ConstantErrors turn_on = drawn_at_power_on(made.gyro, Quantity::rate, normals, number);
    const Vector3 expected = degrees_per_s * (unit.temperature_rate_bias + turn_on.temperature_rate_bias) +
                             play * (unit.temperature_hysteresis + turn_on.temperature_hysteresis) +
                             2 * (unit.vibration_rectification + turn_on.vibration_rectification).col(2);
    EXPECT_LT((error - expected).norm(), 1e-8 * expected.norm()) << number;
  };
  const auto next = [&] { return Vector3(turning.next(imu).rate - turning.rate); };
  next();
  expect(next(), 0, 1, 0.01);
  for (int k = 2; k < 49; ++k) next();
  expect(next(), 0, 1, 0.49);
  // The profile begins again at 20 degrees: the play goes back by what the sensor was warmer, and no rate is known.
  imu.power_on(1);
  expect(next(), 1, 0, 0);
  expect(next(), 1, 1, 0.01);
}

// The case of a unit is turned with all that is in it.
TEST(DrawnErrors, TheMountingTurnsAllSensorsOfAUnit) {
  ImuModel tilted;
  tilted.alignment_sigma = {1e-3, 2e-3, 3e-3};
  std::vector<double> squares(3, 0);
  constexpr int units = 2000;
  for (std::uint64_t seed = 1; seed <= units; ++seed) {
    Turning turning;
    Imu imu(tilted, seed, stream_id("imu1"));
    const Sample sample = turning.next(imu);
    const Vector3 phi = tilted.alignment_sigma.cwiseProduct(
        Normals(seed, stream_id("imu1"))(Quantity::attitude, Process::unit_draw, 0));
    const Matrix3 dcm = exp(phi).toRotationMatrix().transpose();
    ASSERT_LT((sample.rate - dcm * turning.rate).norm(), 1e-12);
    ASSERT_LT((sample.specific_force - dcm * turning.force).norm(), 1e-12);
    for (int i = 0; i < 3; ++i) squares[static_cast<std::size_t>(i)] += phi[i] * phi[i] / units;
  }
  // 16 % is five standard errors of a variance.
  for (int i = 0; i < 3; ++i)
    EXPECT_NEAR(squares[static_cast<std::size_t>(i)] / std::pow(tilted.alignment_sigma[i], 2), 1, 0.16);
}

}  // namespace
}  // namespace imud
