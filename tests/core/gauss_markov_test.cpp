// x <- clamp(A x + P n): its recursion, its statistics against theory and against the reference module's.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "core/imu.hpp"
#include "tests/core/statistics.hpp"
#include "tests/core/vector_table.hpp"

namespace imud {
namespace {

TriadErrors walk(double a, double p, double bound = 0.0) {
  TriadErrors errors;
  errors.walk_transition = a * Matrix3::Identity();
  errors.walk_sqrt_cov = p * Matrix3::Identity();
  errors.walk_bound = Vector3::Constant(bound);
  return errors;
}

TriadErrors coupled_walk() {
  TriadErrors errors;
  errors.walk_transition << 0.9, 0.05, -0.02, 0.0, 0.95, 0.1, 0.03, -0.04, 0.8;
  errors.walk_sqrt_cov << 1e-3, 0, 0, 2e-4, 1e-3, 0, -3e-4, 1e-4, 2e-3;
  errors.walk_bound = {3e-3, 0.0, 5e-3};
  return errors;
}

TEST(GaussMarkov, FollowsItsRecursion) {
  const Normals normals(5, 6);
  TriadErrors mixing = walk(0.9, 1e-3);
  mixing.walk_transition(1, 0) = 0.3;
  for (const TriadErrors& errors :
       {walk(0.97, 1e-3), walk(1.0, 1e-3, 4e-3), walk(0.0, 1e-3), mixing, coupled_walk()}) {
    GaussMarkov process(errors, Quantity::specific_force);
    Vector3 x = Vector3::Zero();
    bool bound_met = false;
    for (std::uint64_t k = 0; k < 2000; ++k) {
      const Vector3 n = normals(Quantity::specific_force, Process::gauss_markov, k);
      const Vector3 free = errors.walk_transition * x + errors.walk_sqrt_cov * n;
      for (int i = 0; i < 3; ++i) {
        const double bound = errors.walk_bound[i] > 0.0 ? errors.walk_bound[i] : 1e9;
        x[i] = std::max(-bound, std::min(free[i], bound));
        bound_met = bound_met || x[i] != free[i];
      }
      ASSERT_LT((process.next(normals, k) - x).norm(), 1e-15) << k;
    }
    EXPECT_EQ(bound_met, errors.walk_bound.norm() > 0.0);
  }
}

TEST(GaussMarkov, WithoutCovarianceIsOff) {
  const Normals normals(5, 6);
  GaussMarkov process(walk(1.0, 0.0, 1.0), Quantity::rate);
  for (std::uint64_t k = 0; k < 10; ++k) EXPECT_EQ(process.next(normals, k), Vector3::Zero());
}

TEST(GaussMarkov, ASingleElementOfTheCovarianceCounts) {
  const Normals normals(5, 6);
  TriadErrors errors = walk(0.0, 0.0);
  errors.walk_sqrt_cov(0, 2) = 1e-3;
  GaussMarkov process(errors, Quantity::rate);
  const Vector3 n = normals(Quantity::rate, Process::gauss_markov, 0);
  EXPECT_LT((process.next(normals, 0) - Vector3(1e-3 * n.z(), 0.0, 0.0)).norm(), 1e-18);
}

TEST(GaussMarkov, SeekGivesTheSameAsTheSequence) {
  const Normals normals(5, 6);
  for (const TriadErrors& errors :
       {walk(0.0, 1e-3), walk(0.0, 1e-3, 1e-3), walk(0.99, 1e-3), walk(1.0, 1e-3, 4e-3), coupled_walk()}) {
    GaussMarkov sequence(errors, Quantity::rate);
    std::vector<Vector3> all;
    for (std::uint64_t k = 0; k < 1000; ++k) all.push_back(sequence.next(normals, k));
    for (const std::uint64_t k : {0U, 1U, 2U, 77U, 998U}) {
      GaussMarkov process(errors, Quantity::rate);
      for (std::uint64_t j = 0; j < 5; ++j) process.next(normals, j);  // wherever it was before
      process.seek(normals, k);
      ASSERT_EQ(process.next(normals, k), all[k]) << k;
      ASSERT_EQ(process.next(normals, k + 1), all[k + 1]) << k;
    }
  }
}

TEST(GaussMarkov, SeekOfWhiteNoiseIsImmediate) {
  const Normals normals(5, 6);
  GaussMarkov process(walk(0.0, 1e-3), Quantity::rate);
  process.seek(normals, 1'000'000'000'000'000'000U);  // step by step this would take a thousand years
  EXPECT_LT((process.next(normals, 1'000'000'000'000'000'000U) -
             1e-3 * normals(Quantity::rate, Process::gauss_markov, 1'000'000'000'000'000'000U))
                .norm(),
            1e-18);
}

// The unbounded walk's variance grows by P^2 a step: over 2000 walks of 200 steps, chi-square with 6000 degrees of
// freedom, 4.9 standard errors of 1/sqrt(3000).
TEST(GaussMarkov, UnboundedWalkGrowsWithTheRoot) {
  constexpr int walks = 2000, steps = 200;
  double square = 0;
  for (std::uint32_t w = 0; w < walks; ++w) {
    const Normals normals(5, w);
    GaussMarkov process(walk(1.0, 1e-3), Quantity::rate);
    Vector3 x = Vector3::Zero();
    for (std::uint64_t k = 0; k < steps; ++k) x = process.next(normals, k);
    square += x.squaredNorm() / (3.0 * walks);
  }
  EXPECT_NEAR(square / (steps * 1e-6), 1.0, 4.9 / std::sqrt(3000.0));
}

// --- The rows of noise_stats.csv
// ------------------------------------------------------------------------------------

// Mean square, mean product of successive values and fraction at the bound, batch by batch, of all three axes.
// Batches are many times longer than the processes remember, so their scatter gives the standard errors.
struct Statistics {
  std::vector<double> square, product, at_bound;

  Statistics(const TriadErrors& errors, Quantity quantity, std::uint64_t batch, std::uint64_t warm_up) {
    const Normals normals(2024, stream_id("statistics"));
    GaussMarkov process(errors, quantity);
    std::uint64_t k = 0;
    Vector3 before = Vector3::Zero();
    for (; k < warm_up; ++k) before = process.next(normals, k);
    const auto n = static_cast<double>(batch);
    for (int b = 0; b < batches_per_axis; ++b) {
      Vector3 sum2 = Vector3::Zero(), sum11 = Vector3::Zero(), bound = Vector3::Zero();
      for (std::uint64_t i = 0; i < batch; ++i, ++k) {
        const Vector3 x = process.next(normals, k);
        sum2 += x.cwiseProduct(x);
        sum11 += x.cwiseProduct(before);
        for (int j = 0; j < 3; ++j) bound[j] += std::abs(x[j]) == errors.walk_bound[j] ? 1.0 : 0.0;
        before = x;
      }
      for (int j = 0; j < 3; ++j) {
        square.push_back(sum2[j] / n);
        product.push_back(sum11[j] / n);
        at_bound.push_back(bound[j] / n);
      }
    }
  }
  static constexpr int batches_per_axis = 30;

  // The standard error of the ratio of two means, from the scatter of product - ratio * square.
  BatchMean lag1() const {
    const double ratio = BatchMean(product).mean / BatchMean(square).mean;
    std::vector<double> residual(square.size());
    for (std::size_t i = 0; i < square.size(); ++i) residual[i] = product[i] - ratio * square[i];
    BatchMean result(residual);
    result.mean = ratio;
    result.standard_error /= BatchMean(square).mean;
    return result;
  }
};

// 5.5 standard errors, themselves known from 90 batches (Student's t, 89 degrees of freedom): a right process fails a
// check once in 2e6 seeds.
constexpr double sigmas = 5.5;

struct Channel {
  std::string name;
  Quantity quantity;
  std::string suffix;
};

TEST(NoiseStatistics, AreThoseOfTheReferenceModule) {
  const VectorTable table("noise_stats");
  int compared = 0;
  for (std::size_t row = 0; row < table.rows(); ++row)
    for (const Channel& channel :
         {Channel{"AngVel", Quantity::rate, "gyro"}, Channel{"Accel", Quantity::specific_force, "accel"}}) {
      if (table.text(row, "channel") != channel.name + "_x") continue;
      const std::string& config = table.text(row, "config");
      SCOPED_TRACE(config + " " + channel.name);
      const double a = table.number(row, "A_" + channel.suffix + "_diag");
      const double bound = table.number(row, "bound_" + channel.suffix);
      // The module scales its noise with the truth; here a scale factor acts on the truth alone.
      const double p = table.number(row, "P_" + channel.suffix + "_diag") *
                       table.number(row, channel.suffix == "gyro" ? "gyroScale" : "accelScale");
      // The correlation time of the square, in steps: the decay of a random walk between bounds 2B apart.
      const double memory = a < 1.0 ? 1.0 / (1.0 - a) : 0.2 * (bound / p) * (bound / p);
      const auto batch = static_cast<std::uint64_t>(std::max(2'000.0, 20.0 * memory));
      const Statistics ours(walk(a, p, bound), channel.quantity, batch, batch);

      double variance = 0, lag1 = 0;  // of the module: three axes, in rows of their own
      for (const char axis : {'x', 'y', 'z'}) {
        std::size_t other = row;
        while (table.text(other, "config") != config || table.text(other, "channel") != channel.name + "_" + axis)
          ++other;
        variance += std::pow(table.number(other, "std"), 2) / 3.0;
        lag1 += table.number(other, "lag1_autocorr") / 3.0;
      }
      // The module's own scatter, for as many steps as it made.
      const double n_ours = static_cast<double>(batch) * Statistics::batches_per_axis;
      const double both = std::sqrt(1.0 + n_ours / table.number(row, "N"));

      const BatchMean our_variance(ours.square);
      EXPECT_LT(std::abs(our_variance.mean - variance), sigmas * both * our_variance.standard_error);
      EXPECT_LT(our_variance.standard_error, 0.06 * variance);  // otherwise the line above is meaningless
      const BatchMean our_lag1 = ours.lag1();
      EXPECT_LT(std::abs(our_lag1.mean - lag1), sigmas * both * our_lag1.standard_error + 1e-6);
      if (bound > 0.0 && channel.suffix == "gyro") {
        const BatchMean fraction(ours.at_bound);
        const double at_x =
            std::sqrt(1.0 + 3.0 * n_ours / table.number(row, "N"));  // the module's figure is for one axis
        EXPECT_LT(std::abs(fraction.mean - table.number(row, "fraction_at_bound_gyro_x")),
                  sigmas * at_x * fraction.standard_error + 5e-6);
      }
      if (bound <= 0.0) {  // theory
        EXPECT_LT(std::abs(our_variance.mean - p * p / (1.0 - a * a)), sigmas * our_variance.standard_error);
        EXPECT_LT(std::abs(our_lag1.mean - a), sigmas * our_lag1.standard_error);
      }
      ++compared;
    }
  EXPECT_EQ(compared, 28);
}

TEST(NoiseStatistics, ClampedWhiteNoiseByTheory) {
  for (const double bound : {0.5, 1.0, 2.0, 3.0}) {
    const Statistics ours(walk(0.0, 1.0, bound), Quantity::rate, 3'000, 0);
    const double outside = std::erfc(bound / std::sqrt(2.0));
    const double density = std::exp(-0.5 * bound * bound) / std::sqrt(2.0 * 3.14159265358979324);
    const double variance = (1.0 - outside) - 2.0 * bound * density + bound * bound * outside;
    const BatchMean square(ours.square), fraction(ours.at_bound);
    EXPECT_LT(std::abs(square.mean - variance), sigmas * square.standard_error) << bound;
    EXPECT_LT(std::abs(fraction.mean - outside), sigmas * fraction.standard_error) << bound;
  }
}

// P P^T is the covariance of a step.
TEST(NoiseStatistics, SqrtCovarianceMixesAxes) {
  TriadErrors errors = walk(0.0, 0.0);
  errors.walk_sqrt_cov << 1.0, 0.0, 0.0, 0.6, 0.8, 0.0, -0.3, 0.2, 0.5;
  const Matrix3 expected = errors.walk_sqrt_cov * errors.walk_sqrt_cov.transpose();
  const Normals normals(3, 4);
  GaussMarkov process(errors, Quantity::rate);
  constexpr std::uint64_t n = 200'000;
  Matrix3 covariance = Matrix3::Zero();
  for (std::uint64_t k = 0; k < n; ++k) {
    const Vector3 x = process.next(normals, k);
    covariance += x * x.transpose() / double{n};
  }
  // The standard error of an element is sqrt((c_ii c_jj + c_ij^2)/n); 4.9 of them, 1e-6 each.
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      EXPECT_LT(std::abs(covariance(i, j) - expected(i, j)),
                4.9 * std::sqrt((expected(i, i) * expected(j, j) + expected(i, j) * expected(i, j)) / double{n}));
}

}  // namespace
}  // namespace imud
