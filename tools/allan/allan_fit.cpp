#include "tools/allan/allan_fit.hpp"

#include <algorithm>
#include <bit>
#include <boost/math/distributions/gamma.hpp>
#include <cmath>
#include <limits>

#include "tools/allan/allan_solver.hpp"

namespace imud {
namespace {

// A gamma distribution with mean 0 and the estimate's variance and skewness; the normal distribution if the
// skewness is 0.
class NullDistribution {
 public:
  explicit NullDistribution(const AllanSolver::Estimate& estimate)
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

// Returns the solution without the terms that are not detected.
AllanSolution seen_terms(const AllanSolver& fit) {
  AllanSolution solution = fit.solve(all_terms);
  while (true) {
    double least_probable = 0;
    TermSet worst = 0;
    for (std::size_t t = 0; t < allan_term_count; ++t) {
      if (!contains(solution.active, t) || std::popcount(solution.active) == 1) continue;
      const AllanSolution without = fit.solve(solution.active & ~(1U << t));
      if (without.active == 0) continue;
      const auto estimate = fit.estimate(t, without);
      const double probability = NullDistribution(estimate).exceeded_with(estimate.square);
      if (probability <= std::max(false_alarm, least_probable)) continue;
      least_probable = probability;
      worst = 1U << t;
    }
    if (worst == 0) return solution;
    solution = fit.solve(solution.active & ~worst);
  }
}

}  // namespace

AllanTerms AllanFit::seen() const noexcept {
  AllanTerms result;
  for (std::size_t t = 0; t < allan_term_count; ++t) result.*allan_term_list[t].value = terms[t].value.value_or(0);
  return result;
}

AllanFit fit_allan_terms(const AllanCurve& curve, double from_s, double to_s) {
  AllanFit result;
  for (auto& term : result.terms) term.least_seen = std::numeric_limits<double>::infinity();
  AllanSolver fit(curve, from_s, to_s);
  if (!fit.is_possible()) return result;
  fit.choose_misfit();
  AllanSolution solution = seen_terms(fit);
  // Flicker that begins at an averaging time is lower at shorter averaging times. Quantization could compensate
  // for the difference; therefore quantization is detected only if flicker alone does not explain the points.
  for (const TermSet allowed : {all_terms & ~quantization_bit, all_terms}) {
    if (!contains(solution.active, flicker_column)) break;
    if (allowed == all_terms && (solution.active & quantization_bit) == 0) break;
    fit.choose_flicker_band(allowed);
    fit.choose_misfit();
    solution = seen_terms(fit);
  }
  result.misfit = fit.misfit();
  if (contains(solution.active, flicker_column)) result.flicker_from_s = fit.flicker_from_s();

  for (std::size_t t = 0; t < allan_term_count; ++t) {
    AllanFit::Term& term = result.terms[t];
    const AllanSolution without =
        fit.solve(contains(solution.active, t) ? solution.active & ~(1U << t) : solution.active);
    if (without.active != 0)
      term.least_seen = std::sqrt(NullDistribution(fit.estimate(t, without)).quantile_of_false_alarm());
    if (!contains(solution.active, t)) continue;
    term.value = std::sqrt(solution.squares[static_cast<Eigen::Index>(t)]);
    term.error = std::sqrt(fit.estimate(t, solution).variance) / (2 * *term.value);
  }
  return result;
}

}  // namespace imud
