// imud's flicker begins at an averaging time. The fit must not take what it lacks below for other noise.
#include <gtest/gtest.h>

#include <limits>

#include "core/effects/flicker.hpp"
#include "tests/tools/synthetic_noise.hpp"
#include "tools/allan/allan_fit.hpp"
#include "tools/allan/flicker_band.hpp"

namespace imud {
namespace {

// Returns the rates of three axes at 100 Hz: white noise, and imud's flicker, which is flat from 1 s on.
std::array<std::vector<double>, 3> emulated_rates(double N, double B, std::size_t count, std::uint64_t seed) {
  constexpr double period_s = 0.01;
  TriadErrors errors;
  errors.bias_instability = Vector3::Constant(B);
  Flicker flicker(errors, Quantity::rate, period_s);
  const Normals normals(seed, 0);
  const Vector3 zero = Vector3::Zero();
  std::array<std::vector<double>, 3> axes;
  SyntheticNoise white(seed);
  for (auto& axis : axes) axis = white.rates({.N = N}, count, period_s);
  for (std::uint64_t k = 0; k < count; ++k) {
    TriadStep step{
        normals,     k,          period_s, static_cast<double>(k) * period_s, zero, zero, TriadStep::ordinary,
        lanes(zero), lanes(zero)};
    flicker.apply(step);
    for (std::size_t axis = 0; axis < axes.size(); ++axis)
      axes[axis][k] += step.error[static_cast<Eigen::Index>(axis)];
  }
  return axes;
}

// In each case 12 recordings: an optical gyro, and a sensor whose flicker is larger than its white noise from 0.03 s
// on. The mean of 12 errors of N, in standard errors, is within 1.3 (false alarm: 7e-6).
TEST(AllanFlicker, ImudsFlickerIsNeitherQuantizationNorLessWhiteNoise) {
  constexpr double infinite = std::numeric_limits<double>::infinity();
  const struct {
    double N, B, largest_error;
    std::size_t count;
  } cases[] = {{1.454e-5, 9.7e-6, 0.0019, 360'000}, {3.4e-4, 2.94e-3, 0.0026, 180'000}};
  for (const auto& [N, B, largest_error, count] : cases) {
    double distance = 0;
    for (std::uint64_t seed = 1; seed <= 4; ++seed)
      for (const auto& rates : emulated_rates(N, B, count, seed)) {
        const auto fit = fit_allan_terms(allan_curve(AllanKind::overlapping, rates, 100, 0, 0.68), 0, infinite);
        EXPECT_EQ(fit.misfit, 0) << B << ' ' << seed;
        EXPECT_FALSE(fit.terms[0].value.has_value()) << B << ' ' << seed;
        ASSERT_TRUE(fit.terms[1].value && fit.terms[2].value) << B << ' ' << seed;
        EXPECT_LT(fit.terms[1].error, largest_error * N) << B << ' ' << seed;
        EXPECT_NEAR(*fit.terms[2].value, B, 4.5 * fit.terms[2].error) << B << ' ' << seed;
        distance += (*fit.terms[1].value - N) / fit.terms[1].error / 12;
      }
    EXPECT_NEAR(distance, 0, 1.3) << B;
  }
}

// The Allan variance of an exponentially correlated process of variance v and correlation time T is, with x = tau/T,
// (2v/x) (1 - (3 - 4 e^-x + e^-2x)/(2x)). imud's processes, linear between their nodes, have 2 % less.
TEST(AllanFlicker, TheShareOfABandIsThatOfItsProcesses) {
  constexpr double ln2_over_pi = 0.22063560015265482, from_s = 1, period_s = 0.01;
  for (const std::size_t factor : {8U, 32U, 100U, 320U, 10'000U}) {
    const double tau = period_s * static_cast<double>(factor);
    double variance = 0, time = Flicker::first_correlation_time(from_s);
    for (std::size_t i = 0; i < 31; ++i, time *= 2) {
      const double x = tau / time;
      const double share = x < 1e-3 ? 2 * x / 3 : 2 / x * (1 - (3 - 4 * std::exp(-x) + std::exp(-2 * x)) / (2 * x));
      variance += Flicker::variance(i, 32) * share;
    }
    const AveragingTime averaging{factor, tau, 1e6};
    EXPECT_NEAR(flicker_share(AllanKind::overlapping, averaging, from_s) / (variance / (2 * ln2_over_pi)), 0.98,
                factor < 32 ? 0.1 : 0.01)
        << factor;
    EXPECT_EQ(flicker_share(AllanKind::overlapping, averaging, 0), 1);
  }
}

}  // namespace
}  // namespace imud
