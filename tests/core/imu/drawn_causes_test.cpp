// Errors that causes share: their distribution over many seeds against the correlations that the loads state, and
// what a sensor shows of them.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <boost/math/distributions/chi_squared.hpp>
#include <boost/math/distributions/normal.hpp>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numeric>
#include <string>
#include <utility>
#include <vector>

#include "core/effects/drawn_errors.hpp"
#include "core/imu.hpp"

namespace imud {
namespace {

// A cause of the whole unit, one of each axis of the unit, and one of each axis at power on: seven deviates.
ImuModel sharing_model() {
  ImuModel model;
  ConstantErrors& gyro = model.gyro.unit_sigma;
  gyro.bias = {1e-3, 2e-3, 3e-3};
  gyro.scale_factor = {4e-4, 5e-4, 6e-4};
  gyro.misalignment << 0, 1e-3, 1e-3, 2e-3, 0, 2e-3, 3e-3, 3e-3, 0;
  gyro.temperature_bias.col(1) = Vector3(1e-4, 2e-4, 3e-4);
  model.accelerometer.unit_sigma.bias = {0.1, 0.2, 0.3};
  model.gyro.turn_on_bias = {1e-2, 2e-2, 3e-2};
  model.gyro.turn_on_sigma.scale_factor = {2e-4, 3e-4, 4e-4};
  model.causes.resize(3);
  Cause &stress = model.causes[0], &axis = model.causes[1], &start = model.causes[2];
  stress.name = "stress";
  stress.gyro.bias = {0.8, -0.6, 0.3};
  stress.gyro.scale_factor = {0.5, 1, 0};
  stress.gyro.temperature_bias.col(1) = Vector3(0.4, 0.4, -0.4);
  stress.accelerometer.bias = {-0.7, 0.2, 0.9};
  axis.name = "axis";
  axis.is_per_axis = true;
  axis.gyro.bias = {0.6, 0.5, -0.9};
  axis.gyro.misalignment << 0, 0.5, 0.5, -0.8, 0, -0.8, 0.3, 0.3, 0;
  axis.accelerometer.bias = {0.7, 0.9, 0.1};
  start.name = "start";
  start.layer = DrawnLayer::turn_on;
  start.is_per_axis = true;
  start.gyro.bias = {0.5, -0.9, 1};
  start.gyro.scale_factor = {0.7, 0.6, 0.5};
  return model;
}

struct DrawnElement {
  double sigma;
  std::array<double, 7> loads;
  std::vector<double> series = {};  // in units of sigma, by seed

  // By the definition of the loads.
  double correlation(const DrawnElement& other) const {
    return std::inner_product(loads.begin(), loads.end(), other.loads.begin(), 0.0);
  }
};

// All elements that are drawn, over the first two power ons: the second one's have no cause in common with the
// first's.
constexpr std::size_t sharing_seeds = 4000;
std::vector<DrawnElement> drawn_elements() {
  const ImuModel model = sharing_model();
  const Cause &stress = model.causes[0], &axis = model.causes[1], &start = model.causes[2];
  std::vector<DrawnElement> all;
  const auto declare = [&](const auto& sigma, const auto& of_unit, const auto& of_axis, const auto& at_start) {
    for (Eigen::Index j = 0; j < sigma.cols(); ++j)
      for (Eigen::Index i = 0; i < 3; ++i) {
        if (sigma(i, j) == 0) continue;
        std::array<double, 7> loads = {of_unit(i, j)};
        loads[static_cast<std::size_t>(1 + i)] = of_axis(i, j);
        loads[static_cast<std::size_t>(4 + i)] = at_start(i, j);
        all.push_back({sigma(i, j), loads});
      }
  };
  const ConstantErrors none;
  for_each_constant(declare, model.gyro.unit_sigma, stress.gyro, axis.gyro, none);
  for_each_constant(declare, model.accelerometer.unit_sigma, stress.accelerometer, axis.accelerometer, none);
  ConstantErrors turn_on = model.gyro.turn_on_sigma;
  turn_on.bias = model.gyro.turn_on_bias;
  for_each_constant(declare, turn_on, none, none, start.gyro);
  for (std::uint64_t seed = 1; seed <= sharing_seeds; ++seed) {
    const Normals normals(seed, stream_id("imu1"));
    std::size_t at = 0;
    const auto append = [&](const ConstantErrors& drawn, const ConstantErrors& sigma) {
      const auto append_term = [&](const auto& term, const auto& deviation) {
        for (Eigen::Index k = 0; k < term.size(); ++k)
          if (deviation.data()[k] != 0) {
            all[at].series.push_back(term.data()[k] / deviation.data()[k]);
            ++at;
          }
      };
      for_each_constant(append_term, drawn, sigma);
    };
    append(drawn_for_unit(model.gyro, Quantity::rate, normals, model.causes), model.gyro.unit_sigma);
    append(drawn_for_unit(model.accelerometer, Quantity::specific_force, normals, model.causes),
           model.accelerometer.unit_sigma);
    ConstantErrors drawn = drawn_at_power_on(model.gyro, Quantity::rate, normals, 0, model.causes);
    // The rest of the bias is TurnOnBias's own.
    drawn.bias += drawn_errors(model.gyro, Quantity::rate, normals, normals, 0, model.causes)
                      .turn_on_bias.cwiseProduct(normals(Quantity::rate, Process::turn_on_bias, 0));
    append(drawn, turn_on);
    EXPECT_EQ(at, all.size());
  }
  return all;
}

// 24 elements: means and variances with a false alarm of 1e-6 each, and 276 correlations with 1e-7 each by Fisher's
// transformation, atanh r ~ N(atanh rho, 1/(n - 3)): 8e-5 in all. A correlation of 0.5 that is off by 0.07 is found.
TEST(DrawnCauses, GiveTheCorrelationsOfTheirLoadsAndLeaveTheStandardDeviations) {
  const std::vector<DrawnElement> all = drawn_elements();
  ASSERT_EQ(all.size(), 24U);
  const double n = sharing_seeds;
  const boost::math::normal normal;
  const auto two_sided = [&](double false_alarm) { return quantile(complement(normal, 0.5 * false_alarm)); };
  const boost::math::chi_squared chi(n);
  const double least = quantile(chi, 0.5e-6), most = quantile(complement(chi, 0.5e-6));
  EXPECT_LT(std::tanh(std::atanh(0.5) + two_sided(1e-7) / std::sqrt(n - 3)), 0.57);
  std::size_t correlated = 0, certain = 0;
  for (std::size_t i = 0; i < all.size(); ++i) {
    const std::vector<double>& a = all[i].series;
    EXPECT_LT(std::abs(std::accumulate(a.begin(), a.end(), 0.0)) / std::sqrt(n), two_sided(1e-6)) << i;
    const double square = std::inner_product(a.begin(), a.end(), a.begin(), 0.0);
    EXPECT_TRUE(square > least && square < most) << i << " " << square / n;
    for (std::size_t j = 0; j < i; ++j) {
      const std::vector<double>& b = all[j].series;
      const double expected = all[i].correlation(all[j]);
      const double other = std::inner_product(b.begin(), b.end(), b.begin(), 0.0);
      const double r = std::inner_product(a.begin(), a.end(), b.begin(), 0.0) / std::sqrt(square * other);
      if (std::abs(expected) > 0.999999)
        ++certain;
      else
        EXPECT_LT(std::abs(std::atanh(r) - std::atanh(expected)) * std::sqrt(n - 3), two_sided(1e-7))
            << i << " " << j << " " << expected << " " << r;
      if (expected != 0) ++correlated;
    }
  }
  EXPECT_EQ(certain, 0U);
  EXPECT_GT(correlated, 60U);
}

// A load of 1 leaves nothing to the element's own deviate.
TEST(DrawnCauses, MayDetermineAnElementAlone) {
  const ImuModel model = sharing_model();
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const Normals normals(seed, stream_id("imu1"));
    const double stress = model.causes[0].drawn(normals, 0).x();
    EXPECT_NEAR(drawn_for_unit(model.gyro, Quantity::rate, normals, model.causes).scale_factor.y(), 5e-4 * stress,
                1e-18);
    EXPECT_EQ(model.causes[0].drawn(normals, 1).x(), stress) << "of the unit";
    for (const std::uint64_t number : {0U, 1U}) {
      const double start = model.causes[2].drawn(normals, number).z();
      EXPECT_NEAR(drawn_at_power_on(model.gyro, Quantity::rate, normals, number, model.causes).bias.z(), 3e-2 * start,
                  1e-17);
    }
    EXPECT_NE(model.causes[2].drawn(normals, 0), model.causes[2].drawn(normals, 1));
  }
}

// The bits of other terms, of other layers, and of the causes themselves do not depend on a cause.
TEST(DrawnCauses, ChangeNothingElse) {
  ImuModel model = sharing_model();
  const Normals normals(3, stream_id("imu1"));
  const ConstantErrors with = drawn_for_unit(model.gyro, Quantity::rate, normals, model.causes);
  const ConstantErrors without = drawn_for_unit(model.gyro, Quantity::rate, normals);
  EXPECT_EQ(with.scale_factor.z(), without.scale_factor.z()) << "no load";
  EXPECT_NE(with.bias, without.bias);
  const std::vector<Cause> start(model.causes.begin() + 2, model.causes.end());
  EXPECT_EQ(drawn_for_unit(model.gyro, Quantity::rate, normals, start).bias, without.bias) << "of another layer";
  std::swap(model.causes[0], model.causes[2]);
  EXPECT_EQ(drawn_for_unit(model.gyro, Quantity::rate, normals, model.causes).misalignment, with.misalignment);
}

// By the formula, from the deviates: after power ons, with another bias and another seed.
TEST(DrawnCauses, AreInWhatTheSensorShows) {
  ImuModel model = sharing_model();
  for (TriadErrors* errors : {&model.gyro, &model.accelerometer}) {
    ConstantErrors only_bias;
    only_bias.bias = errors->unit_sigma.bias;
    errors->unit_sigma = only_bias;
    errors->turn_on_sigma = {};
  }
  const Normals unit(7, stream_id("imu1"));
  const auto expected = [&](const Vector3& bias, std::uint64_t number, const Normals& of_power_on) {
    const auto own = [](double a, double b = 0) { return std::sqrt(std::max(0.0, 1 - (a * a + b * b))); };
    const double c = unit(Quantity::rate, Process::unit_cause, stream_id("stress")).x();
    const Vector3 d = unit(Quantity::rate, Process::unit_cause, stream_id("axis"));
    const Vector3 e = of_power_on(Quantity::rate, Process::turn_on_cause, (number << 32U) + stream_id("start"));
    const Vector3 n = unit(Quantity::rate, Process::unit_draw, 0);
    const Vector3 m = of_power_on(Quantity::rate, Process::turn_on_bias, number);
    return Vector3(
        bias.x() + 1e-3 * (own(0.8, 0.6) * n.x() + 0.8 * c + 0.6 * d.x()) + 1e-2 * (own(0.5) * m.x() + 0.5 * e.x()),
        bias.y() + 2e-3 * (own(0.6, 0.5) * n.y() - 0.6 * c + 0.5 * d.y()) + 2e-2 * (own(0.9) * m.y() - 0.9 * e.y()),
        bias.z() + 3e-3 * (own(0.3, 0.9) * n.z() + 0.3 * c - 0.9 * d.z()) + 3e-2 * e.z());
  };
  Imu imu(model, 7, stream_id("imu1"));
  Nanoseconds since_power_on{0};
  // At rest, where the rate is 0.
  const auto compare = [&](const Vector3& wanted, const std::string& what) {
    since_power_on += Nanoseconds{10'000'000};
    EXPECT_LT((imu.sample_at_rest(since_power_on, DeviceTime{}).rate - wanted).cwiseAbs().maxCoeff(), 1e-15) << what;
  };
  const Vector3 none = Vector3::Zero(), bias(0.1, 0.2, -0.3);
  compare(expected(none, 0, unit), "as delivered");
  imu.power_on(1);
  compare(expected(none, 1, unit), "another power on");
  imu.set_bias(Quantity::rate, bias);
  compare(expected(bias, 1, unit), "another bias");
  imu.set_seed(8);
  imu.power_on(2);
  compare(expected(bias, 2, Normals(8, stream_id("imu1"))), "another power on of another seed");
  Imu reloaded(model, 7, stream_id("imu1"));
  reloaded.continue_from(imu);
  std::swap(imu, reloaded);
  compare(expected(none, 2, Normals(8, stream_id("imu1"))), "reloaded");
}

}  // namespace
}  // namespace imud
