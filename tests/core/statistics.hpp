// Statistics of a series, for tests that compare them with theory.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

namespace imud {

struct Moments {
  double mean = 0, variance = 0, skewness = 0, kurtosis = 0;

  explicit Moments(const std::vector<double>& x) {
    const auto n = static_cast<double>(x.size());
    for (const double v : x) mean += v / n;
    double m3 = 0, m4 = 0;
    for (const double v : x) {
      const double d = v - mean;
      variance += d * d / n;
      m3 += d * d * d / n;
      m4 += d * d * d * d / n;
    }
    skewness = m3 / std::pow(variance, 1.5);
    kurtosis = m4 / (variance * variance);
  }
};

// The correlation of x[i + lag] with y[i]; the autocorrelation of x if y is x.
inline double correlation(const std::vector<double>& x, const std::vector<double>& y, std::size_t lag = 0) {
  const Moments of_x(x), of_y(y);
  double sum = 0;
  for (std::size_t i = lag; i < x.size(); ++i) sum += (x[i] - of_x.mean) * (y[i - lag] - of_y.mean);
  return sum / (static_cast<double>(x.size()) * std::sqrt(of_x.variance * of_y.variance));
}

// The largest distance between the distribution of x and N(0, 1).
inline double kolmogorov_distance(std::vector<double> x) {
  std::sort(x.begin(), x.end());
  const auto n = static_cast<double>(x.size());
  double largest = 0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    const double p = 0.5 * std::erfc(-x[i] / std::sqrt(2.0));
    largest =
        std::max({largest, std::abs(p - static_cast<double>(i) / n), std::abs(p - static_cast<double>(i + 1) / n)});
  }
  return largest;
}

// A mean and its standard error, from the scatter of `batches` batches: right for correlated series too, if a batch
// is much longer than the correlation.
struct BatchMean {
  double mean = 0, standard_error = 0;

  explicit BatchMean(const std::vector<double>& batches) {
    const Moments moments(batches);
    mean = moments.mean;
    standard_error = std::sqrt(moments.variance / (static_cast<double>(batches.size()) - 1.0));
  }
};

}  // namespace imud
