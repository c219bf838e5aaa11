// The noise of poses, and the test of one pose against its neighbours.
#include "core/pose/pose_noise.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <random>
#include <vector>

namespace imud {
namespace {

// Normal noise of variance 1 in each component, the same on every machine but for the last bits of libm.
class Noise {
 public:
  explicit Noise(std::uint64_t seed) : random_(seed) {}
  Vector3 next() { return {normal(), normal(), normal()}; }

 private:
  double unit() { return (static_cast<double>(random_() >> 11) + 0.5) * 0x1p-53; }
  double normal() { return std::sqrt(-2.0 * std::log(unit())) * std::cos(6.283185307179586 * unit()); }
  std::mt19937_64 random_;
};

// 4000 estimates of three components know the mean to 1.3 %; 8 % beside it is no accident.
TEST(PoseNoise, IsThatOfWhiteNoiseAtAnyTimes) {
  Noise noise(1);
  for (const double jitter : {0.0, 0.4}) {
    double sum = 0.0;
    for (int i = 0; i < 4000; ++i) {
      std::array<double, 9> times{};
      std::array<Vector3, 9> values;
      for (std::size_t k = 0; k < 9; ++k) {
        times[k] =
            0.01 * (static_cast<double>(k) + jitter * std::sin(static_cast<double>(9 * i) + static_cast<double>(k)));
        values[k] = 2.0 * noise.next();
      }
      sum += noise_energy(times, values) / 4000.0;
    }
    EXPECT_NEAR(sum, 3.0 * 4.0, 1.0) << jitter;
  }
}

TEST(PoseNoise, DoesNotSeeMotion) {
  std::array<double, 9> times{};
  std::array<Vector3, 9> values;
  for (const double hz : {1.0, 5.0, 10.0}) {
    for (std::size_t k = 0; k < 9; ++k) {
      times[k] = 0.01 * static_cast<double>(k);
      values[k] = Vector3(std::sin(6.283 * hz * times[k]), times[k], 1.0);
    }
    EXPECT_LT(noise_energy(times, values), hz < 6.0 ? 1e-10 : 1e-6) << hz;
  }
}

DeletedResidual test_of(std::size_t before, std::size_t after, const std::function<Vector3(double)>& value) {
  std::vector<double> times;
  std::vector<Vector3> values;
  for (std::size_t k = 0; k < before + after + 1; ++k) {
    times.push_back(0.01 * (static_cast<double>(k) - static_cast<double>(before)));
    values.push_back(value(times.back()));
  }
  return deleted_residual(times, values, before);
}

// The F distribution with 3 and 12 degrees of freedom exceeds 7.0 in 0.56 % of cases, 3.49 in 5 % (SciPy's f.sf).
TEST(PoseNoise, TheRatioOfNoiseHasTheFDistribution) {
  Noise noise(2);
  int above_five = 0, above_half = 0;
  double largest = 0.0, square = 0.0;
  for (int i = 0; i < 20'000; ++i) {
    const DeletedResidual test =
        test_of(6, 3, [&](double t) { return Vector3(noise.next() + Vector3(3.0, -20.0 * t, 900.0 * t * t)); });
    above_five += test.ratio > 3.4903 ? 1 : 0;
    above_half += test.ratio > 7.0 ? 1 : 0;
    largest = std::max(largest, test.ratio);
    square += test.distance * test.distance / (3.0 * test.variance) / 20'000.0;
  }
  EXPECT_NEAR(above_five, 1000, 130);
  EXPECT_NEAR(above_half, 112, 45);
  EXPECT_LT(largest, 60.0);
  EXPECT_NEAR(square, 1.0, 0.04);
}

// A step of velocity or acceleration, wherever it is between two values, is a kink and not an outlier.
TEST(PoseNoise, AKinkIsNoOutlier) {
  const std::vector<std::function<double(double)>> kinks = {
      [](double t) { return std::abs(t); }, [](double t) { return t > 0 ? t : 0.0; },
      [](double t) { return t > 0 ? t * t : 0.0; }, [](double t) { return t > 0 ? 1.0 : 0.0; },
      [](double t) { return std::clamp(t, 0.0, 0.01); }};
  for (std::size_t before = 3; before <= 6; ++before)
    for (double at = -0.06; at < 0.06; at += 0.00125)
      for (const auto& kink : kinks)
        EXPECT_LT(test_of(before, 9 - before, [&](double t) { return Vector3(kink(t - at), 0, 0); }).ratio, 25.0)
            << at;
}

TEST(PoseNoise, AnOutlierIsOne) {
  Noise noise(3);
  for (int i = 0; i < 100; ++i) {
    const DeletedResidual test = test_of(6, 3, [&](double t) {
      return Vector3(0.0002 * noise.next() + Vector3(t == 0.0 ? 0.05 : 0.0, std::sin(10.0 * t), 0));
    });
    EXPECT_NEAR(test.distance, 0.05, 0.004);
    EXPECT_GT(test.ratio, 500.0);
  }
}

}  // namespace
}  // namespace imud
