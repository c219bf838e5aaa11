// The Allan variance of a series, and the band in which the Allan variance of random data lies, for tests of noise.
#pragma once

#include <boost/math/distributions/chi_squared.hpp>
#include <cmath>
#include <cstddef>
#include <vector>

namespace imud {

// The Allan variance of increments at an averaging time of `m` steps of `period_s`, from disjoint pairs of averages.
// Each pair is used once. Therefore the pairs are independent for white noise and for random walks, and `degrees`
// times the estimate over the true value has a chi-square distribution.
struct AllanVariance {
  double sum = 0;
  double degrees = 0;
  double value() const { return sum / degrees; }

  void add(const std::vector<double>& increments, std::size_t m, double period_s) {
    const double tau = static_cast<double>(m) * period_s;
    for (std::size_t begin = 0; begin + 2 * m <= increments.size(); begin += 2 * m) {
      double difference = 0;
      for (std::size_t i = begin; i < begin + m; ++i) difference += increments[i + m] - increments[i];
      sum += 0.5 * difference * difference / (tau * tau);
      degrees += 1;
    }
  }

  // Returns true if data with the Allan variance `expected` can give this estimate. For such data, returns false with
  // the probability `false_alarm`.
  bool fits(double expected, double false_alarm) const {
    const boost::math::chi_squared distribution(degrees);
    const double ratio = degrees * value() / expected;
    return ratio > quantile(distribution, 0.5 * false_alarm) &&
           ratio < quantile(complement(distribution, 0.5 * false_alarm));
  }
};

}  // namespace imud
