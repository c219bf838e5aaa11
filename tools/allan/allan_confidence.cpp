#include "tools/allan/allan_confidence.hpp"

#include <algorithm>
#include <array>
#include <boost/math/distributions/chi_squared.hpp>
#include <boost/math/special_functions/binomial.hpp>
#include <cmath>
#include <limits>

#include "core/numbers/dispatch.hpp"

namespace imud {
namespace {

constexpr double infinite = std::numeric_limits<double>::infinity();
constexpr double longest_sum = 100;     // terms of the basic sum, beyond which a limit replaces it
constexpr double largest_filter = 1e6;  // averages of more points differ by less than the rounding errors

// The numbers of equations in this file are Greenhall and Riley's.

// The generalised autocovariance of phase noise, without its constant factor: (7).
double phase_covariance(double t, int alpha) noexcept {
  const double u = std::abs(t);
  if (u == 0) return 0;
  switch (alpha) {
    case 2:
      return -u;
    case 1:
      return u * u * std::log(u);
    case 0:
      return u * u * u;
    case -1:
      return -std::pow(u, 4) * std::log(u);
    case -2:
      return -std::pow(u, 5);
    case -3:
      return std::pow(u, 6) * std::log(u);
    default:
      return std::pow(u, 7);
  }
}

struct Difference {
  int alpha;
  int order;      // 2: Allan, 3: Hadamard
  double filter;  // points of the averaging filter, m for unmodified variances; may be infinite

  // The autocovariance of the averaged phase: (8).
  double averaged(double t) const noexcept {
    if (filter == infinite) return phase_covariance(t, alpha + 2);
    const double step = 1 / filter;
    return filter * filter *
           (2 * phase_covariance(t, alpha) - phase_covariance(t - step, alpha) - phase_covariance(t + step, alpha));
  }

  // The autocovariance of its differences of the given order: (9).
  double covariance(double t) const noexcept {
    constexpr std::array<std::array<double, 4>, 2> weights = {{{6, -4, 1, 0}, {20, -15, 6, -1}}};
    const auto& weight = weights[order == 2 ? 0 : 1];
    double sum = weight[0] * averaged(t);
    for (int k = 1; k <= order; ++k) sum += weight[static_cast<std::size_t>(k)] * (averaged(t - k) + averaged(t + k));
    return sum;
  }

  // The sum of squared autocovariances over the estimator's M terms, S of them per averaging time, up to J: (10).
  double basic_sum(double J, double M, double S) const noexcept {
    const auto squared = [&](double j) { return std::pow(covariance(j / S), 2); };
    double sum = squared(0) + (1 - J / M) * squared(J);
    for (double j = 1; j < J; ++j) sum += 2 * (1 - j / M) * squared(j);
    return sum;
  }
  double inverse_degrees(double J, double M, double S) const noexcept {
    return basic_sum(J, M, S) / (M * std::pow(covariance(0), 2));
  }
};

struct Limit {
  double a0 = 0, a1 = 0;
};

// Table 1, modified variances; rows: alpha from 2 to -4.
Limit modified_limit(int alpha, int order) noexcept {
  constexpr std::array<std::array<Limit, 2>, 7> table = {{{{{7.0 / 9, 1.0 / 2}, {22.0 / 25, 2.0 / 3}}},
                                                          {{{0.997, 0.616}, {1.141, 0.843}}},
                                                          {{{1.033, 0.607}, {1.184, 0.848}}},
                                                          {{{1.048, 0.534}, {1.180, 0.816}}},
                                                          {{{1.302, 0.535}, {1.175, 0.777}}},
                                                          {{{}, {1.194, 0.703}}},
                                                          {{{}, {1.489, 0.702}}}}};
  return table[static_cast<std::size_t>(2 - alpha)][order == 2 ? 0 : 1];
}

// Table 2, unmodified variances; rows: alpha from 1 to -4.
Limit unmodified_limit(int alpha, int order) noexcept {
  constexpr std::array<std::array<Limit, 2>, 6> table = {{{{{790.0, 410.0}, {9950.0, 6520.0}}},
                                                          {{{2.0 / 3, 1.0 / 3}, {7.0 / 9, 1.0 / 2}}},
                                                          {{{0.852, 0.375}, {0.997, 0.617}}},
                                                          {{{1.079, 0.368}, {1.033, 0.607}}},
                                                          {{{}, {1.053, 0.553}}},
                                                          {{{}, {1.302, 0.535}}}}};
  return table[static_cast<std::size_t>(1 - alpha)][order == 2 ? 0 : 1];
}

// The estimator has M terms, S per averaging time. The recording is r averaging times long.
struct Estimator {
  double M, S, r, J;
};

// Case 1: modified variances.
double modified_degrees(int alpha, int order, const Estimator& e) noexcept {
  const Difference difference{alpha, order, 1};
  if (e.J <= longest_sum) return 1 / difference.inverse_degrees(e.J, e.M, e.S);
  if (e.r > order + 1) {
    const Limit limit = modified_limit(alpha, order);
    return e.r / (limit.a0 - limit.a1 / e.r);
  }
  return 1 / difference.inverse_degrees(longest_sum, longest_sum, longest_sum / e.r);
}

// Case 2: unmodified variances of white or redder noise.
double unmodified_degrees(int alpha, int order, double m, const Estimator& e) noexcept {
  if (e.J <= longest_sum)
    return 1 / Difference{alpha, order, m * (order + 1) <= longest_sum ? m : infinite}.inverse_degrees(e.J, e.M, e.S);
  if (e.r > order + 1) {
    const Limit limit = unmodified_limit(alpha, order);
    return e.r / (limit.a0 - limit.a1 / e.r);
  }
  return 1 / Difference{alpha, order, infinite}.inverse_degrees(longest_sum, longest_sum, longest_sum / e.r);
}

// Case 3: unmodified variances of flicker of the phase.
double flicker_phase_degrees(int order, double m, const Estimator& e) noexcept {
  if (e.J <= longest_sum) return 1 / Difference{1, order, std::min(m, largest_filter)}.inverse_degrees(e.J, e.M, e.S);
  const double b = order == 2 ? 15.23 + 12 * std::log(m) : 47.8 + 40 * std::log(m);  // table 3
  if (e.r > order + 1) {
    const Limit limit = unmodified_limit(1, order);
    return b * b * e.r / (limit.a0 - limit.a1 / e.r);
  }
  const double step = longest_sum / e.r;
  return b * b * longest_sum / Difference{1, order, step}.basic_sum(longest_sum, longest_sum, step);
}

// Case 4: unmodified variances of white phase noise, of which only terms whole averaging times apart are correlated.
double white_phase_degrees(int order, const Estimator& e) {
  const auto d = static_cast<unsigned>(order);
  const auto binomial = [](unsigned n, unsigned k) { return boost::math::binomial_coefficient<double>(n, k); };
  const double middle = std::pow(binomial(2 * d, d), 2);
  const double K = std::ceil(e.r);
  if (K > d) return e.M / (binomial(4 * d, 2 * d) / middle - d / (2 * e.r));
  double sum = 1;
  for (unsigned k = 1; k < K; ++k) sum += 2 * (1 - k / e.r) * std::pow(binomial(2 * d, d - k), 2) / middle;
  return e.M / sum;
}

// The averages of a phase over a factor, times the factor.
class Averages {
 public:
  Averages(std::span<const double> phase, std::size_t factor, const ResidentPages& resident) noexcept
      : phase_(phase), factor_(factor), resident_(resident), count_((phase.size() - 1) / factor) {}
  std::size_t count() const noexcept { return count_; }

  // Subtracts the linear trend by least squares. With n averages a_i and points p_i of the phase, the sum of i a_i
  // is (n - 1) p_n less the sum of the points between the ends. `sum_of_points`: the sum of all points; nullopt:
  // not known.
  void remove_trend(std::optional<double> sum_of_points) noexcept {
    const double begin = phase_[0], end = phase_[count_ * factor_];
    const double inner = sum_of_points ? *sum_of_points - begin - end : inner_points();
    const auto count = static_cast<double>(count_);
    const double xy = (count - 1) / 2 * (begin + end) - inner;
    slope_ = xy / (count * (count * count - 1) / 12);
  }
  // Returns the lag-1 autocorrelation of the averages' differences of an order from 0 to 2; nullopt if these are
  // constant.
  IMUD_DISPATCHED std::optional<double> correlation(std::size_t order) const noexcept {
    const std::size_t count = count_ - order;
    const auto n = static_cast<double>(count);
    const double center = order == 0 ? (phase_[count_ * factor_] - phase_[0]) / n - slope_ * (n - 1) / 2
                                     : (difference(order - 1, count) - difference(order - 1, 0)) / n;
    double products = 0, squares = 0, last = 0;
    for_each_block(order, [&](std::size_t first, std::span<const double> y) {
      squares += sum(y.size(), [&](std::size_t i) { return (y[i] - center) * (y[i] - center); });
      if (first > 0) products += (y[0] - center) * last;
      products += sum(y.size() - 1, [&](std::size_t i) { return (y[i + 1] - center) * (y[i] - center); });
      last = y.back() - center;
    });
    if (!(squares > 0)) return std::nullopt;
    return products / squares;
  }

 private:
  double average(std::size_t i) const noexcept {
    return phase_[(i + 1) * factor_] - phase_[i * factor_] - slope_ * static_cast<double>(i);
  }
  double difference(std::size_t order, std::size_t i) const noexcept {
    if (order == 0) return average(i);
    if (order == 1) return average(i + 1) - average(i);
    return (average(i + 2) - average(i + 1)) - (average(i + 1) - average(i));
  }
  // Four sums at once keep the processor's pipeline busy.
  template <class Value>
  static double sum(std::size_t count, Value&& value) noexcept {
    std::array<double, 4> sums{};
    std::size_t i = 0;
    for (; i + sums.size() <= count; i += sums.size())
      for (std::size_t k = 0; k < sums.size(); ++k) sums[k] += value(i + k);
    for (; i < count; ++i) sums[0] += value(i);
    return (sums[0] + sums[1]) + (sums[2] + sums[3]);
  }
  double inner_points() const noexcept {
    constexpr std::size_t piece = 512;
    double points = 0;
    for (std::size_t first = 1; first < count_; first += piece) {
      const std::size_t size = std::min(piece, count_ - first);
      points += sum(size, [&](std::size_t i) { return phase_[(first + i) * factor_]; });
      resident_.touched(size * std::min(factor_ * sizeof(double), around));
    }
    return points;
  }
  // Calls act(first, differences) for the differences of an order from number `first` on.
  template <class Act>
  void for_each_block(std::size_t order, Act&& act) const {
    std::array<double, 512> values;
    for (std::size_t first = 0; first < count_ - order; first += values.size()) {
      const std::size_t size = std::min(values.size(), count_ - order - first);
      const auto number = static_cast<double>(first);
      if (order == 0 && factor_ == 1)  // in vector registers
        for (int i = 0; i < static_cast<int>(size); ++i) {
          const double* begin = phase_.data() + first + static_cast<std::size_t>(i);
          values[static_cast<std::size_t>(i)] = begin[1] - begin[0] - slope_ * (number + i);
        }
      else if (order == 0)
        for (int i = 0; i < static_cast<int>(size); ++i) {
          const double* begin = phase_.data() + (first + static_cast<std::size_t>(i)) * factor_;
          values[static_cast<std::size_t>(i)] = begin[factor_] - begin[0] - slope_ * (number + i);
        }
      else
        for (std::size_t i = 0; i < size; ++i) values[i] = difference(order, first + i);
      act(first, std::span<const double>(values).first(size));
      resident_.touched(size * std::min(factor_ * sizeof(double), around));
    }
  }

  static constexpr std::size_t around = 65536;  // bytes that the system maps about an address

  std::span<const double> phase_;
  std::size_t factor_;
  const ResidentPages& resident_;
  std::size_t count_;
  double slope_ = 0;
};

}  // namespace

int reddest_noise(AllanKind kind) noexcept { return is_hadamard(kind) ? -4 : -2; }

std::optional<int> identify_noise(AllanKind kind, std::span<const double> phase, std::size_t factor,
                                  const ResidentPages& resident, std::optional<double> sum_of_points) {
  constexpr std::size_t least_averages = 30;
  constexpr int most_differences = 2;
  if (phase.empty() || (phase.size() - 1) / factor < least_averages) return std::nullopt;
  Averages averages(phase, factor, resident);
  averages.remove_trend(sum_of_points);
  for (int differences = 0;; ++differences) {
    const auto correlation = averages.correlation(static_cast<std::size_t>(differences));
    if (!correlation) return std::nullopt;
    const double half_exponent = *correlation / (1 + *correlation);
    if (half_exponent < 0.25 || differences == most_differences) {
      const double alpha = -2 * (half_exponent + differences);
      return static_cast<int>(std::lround(
          std::clamp(alpha, static_cast<double>(reddest_noise(kind)), static_cast<double>(whitest_noise))));
    }
  }
}

double degrees_of_freedom(AllanKind kind, int alpha, std::size_t points, std::size_t factor) {
  const auto m = static_cast<double>(factor);
  const auto N = static_cast<double>(points);
  if (kind == AllanKind::total) {
    constexpr std::array<Limit, 3> table = {{{1.50, 0}, {1.17, 0.22}, {0.93, 0.36}}};
    const Limit& row = table[static_cast<std::size_t>(std::clamp(-alpha, 0, 2))];
    if (alpha <= 0) return std::max(1.0, row.a0 * (N - 1) / m - row.a1);
    // The reflected differences all contain the phase at an end of the record, four times in the square: their common
    // part has the relative variance 16/9 (tau/T)^2 for white phase.
    factor = std::min(factor, largest_factor(AllanKind::overlapping, points));
    const double inner = degrees_of_freedom(AllanKind::overlapping, alpha, points, factor);
    return std::max(1.0, 1 / (1 / inner + 8.0 / 9 * std::pow(m / (N - 1), 2)));
  }
  const auto order = static_cast<int>(order_of(kind));
  const bool is_modified = kind == AllanKind::modified;
  const double S = kind == AllanKind::allan || kind == AllanKind::hadamard ? 1 : m;
  const double length = (is_modified ? m : 1) + m * order;
  Estimator e{};
  e.M = 1 + std::floor(S * (N - length) / m);
  e.S = S;
  e.r = e.M / S;
  e.J = std::min(e.M, (order + 1) * S);
  double degrees = 0;
  if (is_modified)
    degrees = modified_degrees(alpha, order, e);
  else if (alpha <= 0)
    degrees = unmodified_degrees(alpha, order, m, e);
  else if (alpha == 1)
    degrees = flicker_phase_degrees(order, m, e);
  else
    degrees = white_phase_degrees(order, e);
  return std::max(1.0, degrees);
}

DeviationBounds deviation_bounds(double deviation, double degrees, double confidence) {
  const boost::math::chi_squared distribution(degrees);
  return {deviation * std::sqrt(degrees / quantile(distribution, (1 + confidence) / 2)),
          deviation * std::sqrt(degrees / quantile(distribution, (1 - confidence) / 2))};
}

}  // namespace imud
