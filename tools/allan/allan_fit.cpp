#include "tools/allan/allan_fit.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <bit>
#include <boost/math/distributions/gamma.hpp>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

namespace imud {
namespace {

using Eigen::ArrayXd;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using Active = unsigned;  // a set of terms: bits in the order of allan_term_list
constexpr Active all_terms = (1U << allan_term_count) - 1;
constexpr Active ramp = 1U << 4U;

bool has(Active set, std::size_t term) noexcept { return ((set >> term) & 1U) != 0; }

// A solution: the squares of the coefficients, the resulting variances, and the variances' uncertainty.
struct Solution {
  Active active = 0;
  VectorXd squares = VectorXd::Zero(allan_term_count);
  VectorXd noise;        // expected variance at each point, without the ramp's
  VectorXd model;        // with it
  VectorXd uncertainty;  // variance of the measured variance
};

class Fit {
 public:
  Fit(const AllanCurve& curve, double from_s, double to_s);

  bool is_possible() const noexcept { return measured_.size() >= 2 && measured_.minCoeff() > 0; }
  Solution solve(Active allowed) const;
  // Chooses the misfit at which the residuals of the solution are as large as expected.
  void choose_misfit();
  double misfit() const noexcept { return misfit_; }

  struct Estimate {
    double square = 0;    // of the coefficient; may be negative
    double variance = 0;  // of `square`
    double skewness = 0;  // of its distribution
  };
  // Estimates a term with the solution's terms. The estimate's distribution has the solution's noise alone.
  Estimate estimate(std::size_t term, const Solution& solution) const;

 private:
  VectorXd weighted_squares(Active set, const VectorXd& weights) const;
  ArrayXd density(const Solution& solution) const;

  AllanKind kind_;
  double period_;
  double length_;
  double misfit_ = 0;
  VectorXd measured_;  // the variance of each point
  VectorXd degrees_;   // of freedom, by the noise identified
  MatrixXd spread_;    // the root of twice the inverse degrees, if the noise is the term's alone
  MatrixXd unit_;      // a row for each point, a column for each term
  ArrayXd frequency_;  // Hz, in equal steps of the logarithm
  ArrayXd step_;       // Hz, of the integral over the frequency
  MatrixXd gain_;      // a column for each point: its response to the density
};

// The squared response of a deviation to a rate of frequency f: the square of the average over m samples, and of the
// differences of such averages.
double response(AllanKind kind, double f, double period, double m) noexcept {
  const double s = std::sin(std::numbers::pi * f * period * m);
  const double average = std::pow(s / (m * std::sin(std::numbers::pi * f * period)), 2);
  if (kind == AllanKind::modified) return 2 * s * s * average * average;
  return is_hadamard(kind) ? 8.0 / 3 * std::pow(s, 4) * average : 2 * s * s * average;
}

Fit::Fit(const AllanCurve& curve, double from_s, double to_s)
    : kind_(curve.kind), period_(curve.period_s), length_(curve.record_length) {
  std::vector<AllanCurve::Point> points;
  for (const auto& point : curve.points)
    if (point.tau_s >= from_s * (1 - 1e-9) && point.tau_s <= to_s * (1 + 1e-9)) points.push_back(point);
  const auto size = static_cast<Eigen::Index>(points.size());
  measured_.resize(size);
  degrees_.resize(size);
  spread_ = MatrixXd::Zero(size, allan_term_count);
  unit_.resize(size, allan_term_count);

  constexpr Eigen::Index frequencies = 4000;
  const double lowest = 0.02 / length_, highest = 0.5 / period_;
  const double ratio = std::log(highest / lowest) / static_cast<double>(frequencies);
  frequency_ = (std::log(lowest) + ratio * (ArrayXd::LinSpaced(frequencies, 0, frequencies - 1) + 0.5)).exp();
  step_ = frequency_ * ratio;
  gain_.resize(frequencies, size);
  for (Eigen::Index i = 0; i < size; ++i) {
    const auto& point = points[static_cast<std::size_t>(i)];
    measured_[i] = point.deviation * point.deviation;
    degrees_[i] = point.degrees;
    constexpr std::array<int, 4> exponents = {2, 0, -1, -2};
    for (std::size_t t = 0; t < exponents.size(); ++t)
      spread_(i, static_cast<Eigen::Index>(t)) =
          std::sqrt(2 / degrees_of_freedom(kind_, exponents[t], curve.samples + 1, point.factor));
    const auto unit = unit_variances(kind_, curve.time(point));
    for (std::size_t t = 0; t < allan_term_count; ++t) unit_(i, static_cast<Eigen::Index>(t)) = unit[t];
    for (Eigen::Index k = 0; k < frequencies; ++k)
      gain_(k, i) = response(kind_, frequency_[k], period_, static_cast<double>(point.factor));
  }
}

// Returns the weighted least-squares estimate with exactly these terms.
VectorXd Fit::weighted_squares(Active set, const VectorXd& weights) const {
  std::vector<Eigen::Index> columns;
  for (std::size_t t = 0; t < allan_term_count; ++t)
    if (has(set, t)) columns.push_back(static_cast<Eigen::Index>(t));
  const MatrixXd x = weights.cwiseSqrt().asDiagonal() * unit_(Eigen::all, columns);
  const VectorXd scale = x.colwise().norm().cwiseInverse();
  const MatrixXd scaled = x * scale.asDiagonal();
  const VectorXd y = weights.cwiseSqrt().cwiseProduct(measured_);
  VectorXd squares = VectorXd::Zero(allan_term_count);
  squares(columns) = scale.cwiseProduct((scaled.transpose() * scaled).ldlt().solve(scaled.transpose() * y));
  return squares;
}

// Finds the best of all subsets of `allowed` whose terms are all positive, which is the non-negative solution, and
// repeats it with the weights of the solution.
Solution Fit::solve(Active allowed) const {
  Solution solution;
  solution.noise = solution.model = measured_;
  constexpr int most_rounds = 50;
  for (int round = 0; round < most_rounds; ++round) {
    const ArrayXd n = solution.noise;
    const ArrayXd v = solution.model;
    const ArrayXd deviation = round == 0 ? ArrayXd(n * (2 / degrees_.array()).sqrt())
                                         : ArrayXd(VectorXd(spread_.cwiseProduct(unit_) * solution.squares));
    // The ramp is no noise: its square shifts chi-square and makes it non-central.
    solution.uncertainty =
        (deviation.square() * (1 + 2 * (v - n) / n) + (misfit_ * v).square()).max(1e-18 * v.square());
    const VectorXd weights = solution.uncertainty.cwiseInverse();
    double best = std::numeric_limits<double>::infinity();
    Solution next = solution;
    for (Active set = 1; set <= all_terms; ++set) {
      if ((set & ~allowed) != 0) continue;
      if ((set & ramp) != 0 && unit_.col(4).maxCoeff() == 0) continue;
      const VectorXd squares = weighted_squares(set, weights);
      bool is_positive = true;
      for (std::size_t t = 0; t < allan_term_count; ++t)
        is_positive = is_positive && (!has(set, t) || squares[static_cast<Eigen::Index>(t)] > 0);
      if (!is_positive) continue;
      const double distance = (weights.array() * (unit_ * squares - measured_).array().square()).sum();
      if (distance >= best) continue;
      best = distance;
      next.active = set;
      next.squares = squares;
    }
    if (!std::isfinite(best)) return Solution{};
    next.model = unit_ * next.squares;
    next.noise = next.model - unit_.col(4) * next.squares[4];
    if ((next.active & ~ramp) == 0) next.noise = 1e-6 * next.model;
    const double change = ((next.model - solution.model).array() / solution.model.array()).abs().maxCoeff();
    solution = next;
    if (change < 1e-6) break;
  }
  return solution;
}

void Fit::choose_misfit() {
  const auto excess = [&](double misfit) {
    misfit_ = misfit;
    const Solution s = solve(all_terms);
    if (s.active == 0) return 0.0;
    // The deviance of gamma distributions, whose points' skewness does not enlarge it as it does a sum of squares.
    const ArrayXd ratio = measured_.array() / s.model.array();
    const ArrayXd degrees = 2 * s.model.array().square() / s.uncertainty.array();
    const double freedom = static_cast<double>(measured_.size()) - std::popcount(s.active);
    return (degrees * (ratio - 1 - ratio.log())).sum() / std::max(1.0, freedom);
  };
  constexpr double too_much = 2.5;  // neighbouring points are correlated: their sum scatters
  misfit_ = 0;
  if (excess(0) <= too_much) {
    misfit_ = 0;
    return;
  }
  double low = 1e-6, high = 10;
  for (int i = 0; i < 40; ++i) {
    const double middle = std::sqrt(low * high);
    (excess(middle) > 1 ? low : high) = middle;
  }
  misfit_ = high;
}

// The two-sided density of the solution's noise.
ArrayXd Fit::density(const Solution& solution) const {
  const ArrayXd omega = 2 * std::numbers::pi * frequency_;
  const VectorXd& q = solution.squares;
  return 4 * q[0] / period_ * (omega * (period_ / 2)).sin().square() + q[1] + q[2] / omega + q[3] / omega.square();
}

Fit::Estimate Fit::estimate(std::size_t term, const Solution& solution) const {
  // The estimate is a sum of the measured variances with the weights `c`, a row of the pseudo-inverse.
  std::vector<Eigen::Index> columns = {static_cast<Eigen::Index>(term)};
  for (std::size_t t = 0; t < allan_term_count; ++t)
    if (t != term && has(solution.active, t)) columns.push_back(static_cast<Eigen::Index>(t));
  const VectorXd weights = solution.uncertainty.cwiseInverse();
  const MatrixXd x = weights.cwiseSqrt().asDiagonal() * unit_(Eigen::all, columns);
  const VectorXd scale = x.colwise().norm().cwiseInverse();
  const MatrixXd scaled = x * scale.asDiagonal();
  VectorXd first = VectorXd::Zero(scaled.cols());
  first[0] = 1;
  const VectorXd row = (scaled.transpose() * scaled).ldlt().solve(first);
  const VectorXd c = scale[0] * weights.cwiseSqrt().cwiseProduct(scaled * row);

  // Averages over a time T of squares of filtered noise have, with the gain G of the sum and the density S, the
  // cumulants 2/T int G^2 S^2 df and 8/T^2 int G^3 S^3 df over all f. At long averaging times fewer terms than T/tau
  // count, which the degrees of freedom know: they scale each point.
  const ArrayXd S = density(solution);
  Estimate estimate;
  estimate.square = c.dot(measured_);
  if ((solution.active & ~ramp) == 0) {
    estimate.variance = c.array().square().matrix().dot(solution.uncertainty);
    return estimate;
  }
  VectorXd scaled_c = c;
  for (Eigen::Index i = 0; i < c.size(); ++i) {
    const double asymptotic = 4 / length_ * ((gain_.col(i).array() * S).square() * step_).sum();
    const double known = solution.uncertainty[i] - std::pow(misfit_ * solution.model[i], 2);
    scaled_c[i] *= std::sqrt(std::max(0.0, known) / asymptotic);
  }
  const auto second = [&](const VectorXd& w) {
    return 4 / length_ * (((gain_ * w).array() * S).square() * step_).sum();
  };
  const double plain = second(c), true_second = second(scaled_c);
  const double third = 16 / (length_ * length_) * (((gain_ * scaled_c).array() * S).cube() * step_).sum();
  estimate.variance = true_second + misfit_ * misfit_ * (c.array() * solution.model.array()).square().sum();
  estimate.skewness =
      true_second > 0 ? third / std::pow(estimate.variance, 1.5) * std::sqrt(std::max(1.0, true_second / plain)) : 0;
  return estimate;
}

// A gamma distribution with mean 0 and the estimate's variance and skewness; the normal one if it is not skewed.
class NullDistribution {
 public:
  explicit NullDistribution(const Fit::Estimate& estimate)
      : deviation_(std::sqrt(estimate.variance)), gamma_(4 / std::pow(std::max(estimate.skewness, 0.01), 2)) {}
  double exceeded_with(double square) const {
    const double k = gamma_.shape();
    const double x = k + square / deviation_ * std::sqrt(k);
    return x <= 0 ? 1 : cdf(complement(gamma_, x));
  }
  double quantile_of_false_alarm() const {
    const double k = gamma_.shape();
    return deviation_ * (quantile(complement(gamma_, false_alarm)) - k) / std::sqrt(k);
  }

 private:
  double deviation_;
  boost::math::gamma_distribution<> gamma_;
};

}  // namespace

AllanTerms AllanFit::seen() const noexcept {
  AllanTerms result;
  for (std::size_t t = 0; t < allan_term_count; ++t) result.*allan_term_list[t].value = terms[t].value.value_or(0);
  return result;
}

AllanFit fit_allan_terms(const AllanCurve& curve, double from_s, double to_s) {
  AllanFit result;
  for (auto& term : result.terms) term.least_seen = std::numeric_limits<double>::infinity();
  Fit fit(curve, from_s, to_s);
  if (!fit.is_possible()) return result;
  fit.choose_misfit();
  result.misfit = fit.misfit();

  Solution solution = fit.solve(all_terms);
  while (true) {
    double least_probable = 0;
    Active worst = 0;
    for (std::size_t t = 0; t < allan_term_count; ++t) {
      if (!has(solution.active, t) || std::popcount(solution.active) == 1) continue;
      const Solution without = fit.solve(solution.active & ~(1U << t));
      if (without.active == 0) continue;
      const auto estimate = fit.estimate(t, without);
      const double probability = NullDistribution(estimate).exceeded_with(estimate.square);
      if (probability <= std::max(false_alarm, least_probable)) continue;
      least_probable = probability;
      worst = 1U << t;
    }
    if (worst == 0) break;
    solution = fit.solve(solution.active & ~worst);
  }

  for (std::size_t t = 0; t < allan_term_count; ++t) {
    AllanFit::Term& term = result.terms[t];
    const Solution without = fit.solve(has(solution.active, t) ? solution.active & ~(1U << t) : solution.active);
    if (without.active != 0)
      term.least_seen = std::sqrt(NullDistribution(fit.estimate(t, without)).quantile_of_false_alarm());
    if (!has(solution.active, t)) continue;
    term.value = std::sqrt(solution.squares[static_cast<Eigen::Index>(t)]);
    term.error = std::sqrt(fit.estimate(t, solution).variance) / (2 * *term.value);
  }
  return result;
}

}  // namespace imud
