// PolynomialFit: polynomials, and the noise of a derivative to one side.
#include "core/pose/polynomial_fit.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <random>

namespace imud {
namespace {

constexpr double step_s = 0.01;

// Uniform in [0, 1), the same on every machine.
double unit_noise(std::mt19937_64& random) { return static_cast<double>(random() >> 11) * 0x1p-53; }

// Fits value(t) at `count` points, of which `before` precede time 0.
template <class Value>
PolynomialFit::Derivatives fit_of(std::size_t before, std::size_t count, Value value) {
  PolynomialFit fit(count);
  for (std::size_t j = 0; j < count; ++j) {
    const double t = step_s * (static_cast<double>(j) - static_cast<double>(before));
    fit.add(t, value(t));
  }
  return fit.at_0();
}

struct WindowCase {
  std::size_t before, count;
  int degree;
};

TEST(PolynomialFit, ReproducesPolynomials) {
  for (const WindowCase& c :
       {WindowCase{3, 7, 6}, {10, 21, 8}, {0, 13, 6}, {12, 13, 6}, {1, 61, 8}, {0, 2, 1}, {0, 1, 0}}) {
    const double unit_s = step_s * static_cast<double>(c.count);
    const auto value = [&](double t) {
      double sum = 0.0;
      for (int k = c.degree; k >= 0; --k) sum = sum * (t / unit_s) + 1.0 + k;  // 1 + 2 u + 3 u^2 + ...
      return Vector3(sum, -sum, 2.0);
    };
    const PolynomialFit::Derivatives d = fit_of(c.before, c.count, value);
    const double first = c.degree < 1 ? 0.0 : 2.0 / unit_s, second = c.degree < 2 ? 0.0 : 6.0 / (unit_s * unit_s);
    EXPECT_LT((d.value - Vector3(1, -1, 2)).norm(), 1e-12) << c.count;
    EXPECT_LT((d.first - Vector3(first, -first, 0)).norm() * unit_s, 1e-10) << c.count;
    EXPECT_LT((d.second - Vector3(second, -second, 0)).norm() * unit_s * unit_s, 1e-8) << c.count;
  }
}

// At an end of 13 points, the first derivative of the sixth degree has 2.872 times the noise of a point, per step
// (numpy.linalg.pinv of the Vandermonde matrix). 4000 fits of three axes know a mean square to 1.3 %; with 10 %
// beside the expected value, a false alarm is below 1e-12, and the seed is fixed.
TEST(PolynomialFit, ReducesNoiseAndAddsNone) {
  constexpr double full = 2.872 * 2.872;
  std::mt19937_64 random(1);
  // Returns a number of variance 1.
  const auto noise = [&random] {
    const double sum = unit_noise(random) + unit_noise(random) + unit_noise(random) + unit_noise(random);
    return (sum - 2.0) * std::sqrt(3.0);
  };
  for (const double amplitude : {0.0, 1e1, 1e2, 3e2, 1e3, 2e3, 3e3, 4e3, 6e3}) {
    constexpr int fits = 4000;
    double square = 0.0;
    for (int i = 0; i < fits; ++i) {
      // A quarter of an oscillation within the window, of any phase, with coefficients that fall below the noise.
      const double phase = 6.28 * static_cast<double>(i) / fits, w = 3.0 / (12 * step_s);
      const auto d = fit_of(0, 13, [&](double t) {
        return Vector3(noise(), noise() + 5.0 * t, noise() + amplitude * std::sin(w * t + phase));
      });
      square += (d.first - Vector3(0, 5, amplitude * w * std::cos(phase))).squaredNorm() * step_s * step_s;
    }
    const double ratio = square / (3 * fits * full);
    EXPECT_LT(ratio, amplitude == 0.0 ? 0.05 : 1.1) << amplitude;
  }
}

// Without noise the motion raises the degree, to the tenth: numpy's fit of that has the errors 8.88e-6 and 4.80e-3
// here, the ninth 7.6e-5 and 0.037, the sixth 0.039 and 11.
TEST(PolynomialFit, FollowsAMotionWithoutNoise) {
  constexpr double w = 3.0 / (12 * step_s);
  const auto d = fit_of(0, 13, [](double t) { return Vector3(std::sin(w * t), std::cos(w * t), 0); });
  EXPECT_LT((d.first - Vector3(w, 0, 0)).norm(), 9e-6);
  EXPECT_LT((d.second - Vector3(0, -w * w, 0)).norm(), 5e-3);
}

// With points on both sides the fit is linear: nothing depends on the noise.
TEST(PolynomialFit, IsLinearInside) {
  std::mt19937_64 random(2);
  std::array<Vector3, 21> noise;
  for (Vector3& vector : noise) vector = Vector3(unit_noise(random), unit_noise(random), unit_noise(random));
  const auto at = [&](double t) { return noise[static_cast<std::size_t>(std::lround(t / step_s + 10.0))]; };
  const auto motion = [](double t) { return Vector3(100 * std::sin(30 * t), 100 * std::cos(30 * t), t); };
  const auto both = fit_of(10, 21, [&](double t) { return Vector3(at(t) + motion(t)); });
  const auto first = fit_of(10, 21, at), second = fit_of(10, 21, motion);
  EXPECT_LT((both.first - first.first - second.first).norm(), 1e-9);
  EXPECT_LT((both.second - first.second - second.second).norm(), 1e-6);
}

}  // namespace
}  // namespace imud
