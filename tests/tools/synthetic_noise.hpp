// Noise with given terms, one sample per period. The same seed gives the same noise on every machine.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <random>
#include <vector>

#include "core/numbers/random.hpp"
#include "tools/allan/allan_term_list.hpp"

namespace imud {

class SyntheticNoise {
 public:
  explicit SyntheticNoise(std::uint64_t seed) : bits_(seed) {}

  double normal() { return inverse_normal_cdf(uniform(bits_())); }

  // Returns rates averaged over each period that have all these terms.
  std::vector<double> rates(const AllanTerms& terms, std::size_t count, double period_s) {
    std::vector<double> rates(count);
    if (terms.N > 0)
      for (double& rate : rates) rate += terms.N / std::sqrt(period_s) * normal();
    if (terms.B > 0) add_flicker(rates, terms.B);
    if (terms.K > 0) {
      // The average of a random walk over a period: the mean of both ends, and the deviation of the walk between
      // them.
      const double step = terms.K * std::sqrt(period_s);
      double before = 0;
      for (double& rate : rates) {
        const double after = before + step * normal();
        rate += (before + after) / 2 + step / std::sqrt(12.0) * normal();
        before = after;
      }
    }
    if (terms.Q > 0) {
      double before = terms.Q * normal();
      for (double& rate : rates) {
        const double after = terms.Q * normal();
        rate += (after - before) / period_s;
        before = after;
      }
    }
    for (std::size_t i = 0; i < count; ++i) rates[i] += terms.R * period_s * (static_cast<double>(i) + 0.5);
    return rates;
  }

 private:
  // A sum of Gauss-Markov processes whose correlation times are octaves, from one sample to four times the record:
  // together they have the density B^2/(2 pi f) within 1 % of it.
  void add_flicker(std::vector<double>& rates, double B) {
    const double sigma = B * std::sqrt(std::numbers::ln2 / std::numbers::pi);
    for (double time = 0.5; time < 4 * static_cast<double>(rates.size()); time *= 2) {
      const double keep = std::exp(-1 / time);
      const double drive = sigma * std::sqrt(1 - keep * keep);
      double x = sigma * normal();
      for (double& rate : rates) {
        rate += x;
        x = keep * x + drive * normal();
      }
    }
  }

  std::mt19937_64 bits_;
};

}  // namespace imud
