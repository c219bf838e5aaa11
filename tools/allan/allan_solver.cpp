#include "tools/allan/allan_solver.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <numbers>

#include "tools/allan/flicker_band.hpp"

namespace imud {

using Eigen::ArrayXd;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

constexpr double least_periods = 4;    // of a sample, from which on flicker may be flat: beyond them it has no effect
constexpr double longest_band = 0.01;  // of the record, so that flicker is not taken for a random walk

}  // namespace

AllanSolver::AllanSolver(const AllanCurve& curve, double from_s, double to_s)
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
      gain_(k, i) = allan_response(kind_, frequency_[k], period_, static_cast<double>(point.factor));
  }
  flicker_unit_ = unit_.col(flicker_column);
  flicker_spread_ = spread_.col(flicker_column);
  flicker_density_ = ArrayXd::Ones(frequencies);
  first_band_ = least_periods * period_;
  last_band_ = longest_band * length_;
}

ArrayXd AllanSolver::flicker_densities(double from_s) const {
  const FlickerBand band(from_s, period_);
  return frequency_.unaryExpr([&](double f) { return band.density(f); });
}

void AllanSolver::set_flicker_band(double from_s) {
  const VectorXd ideal = step_ / frequency_;
  const VectorXd ideal_square = step_ / frequency_.square();
  const auto share = [&](const ArrayXd& density) {
    return ArrayXd((gain_.transpose() * density.matrix().cwiseProduct(ideal)).array() /
                   (gain_.transpose() * ideal).array());
  };
  const auto scatter = [&](const ArrayXd& density) -> ArrayXd {
    return ArrayXd(
               (gain_.array().square().matrix().transpose() * density.square().matrix().cwiseProduct(ideal_square))
                   .array() /
               (gain_.array().square().matrix().transpose() * ideal_square).array())
        .sqrt();
  };
  constexpr double small = 1.05;
  const double beside = from_s == 0 ? first_band_ : small * from_s;
  flicker_from_ = from_s;
  flicker_density_ = flicker_densities(from_s);
  const ArrayXd here = share(flicker_density_);
  unit_.col(flicker_column) = flicker_unit_.array() * here;
  spread_.col(flicker_column) = flicker_spread_.array() * scatter(flicker_density_) / here;
  flicker_change_ =
      flicker_unit_.array() * (share(flicker_densities(beside)) - here) / std::log(from_s == 0 ? 2 : small);
}

double AllanSolver::deviance(const AllanSolution& s) const {
  // The deviance of gamma distributions. The skewness of the points does not enlarge the deviance, but would
  // enlarge a sum of squares.
  const ArrayXd ratio = measured_.array() / s.model.array();
  const ArrayXd degrees = 2 * s.model.array().square() / s.uncertainty.array();
  return (degrees * (ratio - 1 - ratio.log())).sum();
}

double AllanSolver::distance_with_band(double from_s, TermSet allowed) {
  set_flicker_band(from_s);
  const AllanSolution solution = solve(allowed);
  return contains(solution.active, flicker_column) ? deviance(solution) : std::numeric_limits<double>::infinity();
}

void AllanSolver::choose_flicker_band(TermSet allowed) {
  constexpr double surely_closer = 1;  // of the deviance: otherwise flicker is flat at all averaging times
  misfit_ = 0;
  double best = 0, least = distance_with_band(0, allowed) - surely_closer;
  const auto attempt = [&](double from_s) {
    if (from_s < first_band_ || from_s > last_band_) return;
    const double distance = distance_with_band(from_s, allowed);
    if (distance >= least) return;
    least = distance;
    best = from_s;
  };
  double ratio = std::numbers::sqrt2;
  for (double from = first_band_; from <= last_band_; from *= ratio) attempt(from);
  for (int i = 0; i < 8 && best > 0; ++i) {
    ratio = std::sqrt(ratio);
    const double middle = best;
    attempt(middle * ratio);
    attempt(middle / ratio);
  }
  set_flicker_band(best);
}

// Returns the weighted least-squares estimate with exactly these terms.
VectorXd AllanSolver::weighted_squares(TermSet set, const VectorXd& weights) const {
  std::vector<Eigen::Index> columns;
  for (std::size_t t = 0; t < allan_term_count; ++t)
    if (contains(set, t)) columns.push_back(static_cast<Eigen::Index>(t));
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
AllanSolution AllanSolver::solve(TermSet allowed) const {
  AllanSolution solution;
  solution.noise = solution.model = measured_;
  constexpr int most_rounds = 50;
  for (int round = 0; round < most_rounds; ++round) {
    const ArrayXd n = solution.noise;
    const ArrayXd v = solution.model;
    const ArrayXd deviation = round == 0 ? ArrayXd(n * (2 / degrees_.array()).sqrt())
                                         : ArrayXd(VectorXd(spread_.cwiseProduct(unit_) * solution.squares));
    // The ramp is no noise: its square shifts chi-square, which becomes non-central.
    solution.uncertainty =
        (deviation.square() * (1 + 2 * (v - n) / n) + (misfit_ * v).square()).max(1e-18 * v.square());
    const VectorXd weights = solution.uncertainty.cwiseInverse();
    double best = std::numeric_limits<double>::infinity();
    AllanSolution next = solution;
    for (TermSet set = 1; set <= all_terms; ++set) {
      if ((set & ~allowed) != 0) continue;
      if ((set & ramp_bit) != 0 && unit_.col(4).maxCoeff() == 0) continue;
      const VectorXd squares = weighted_squares(set, weights);
      bool is_positive = true;
      for (std::size_t t = 0; t < allan_term_count; ++t)
        is_positive = is_positive && (!contains(set, t) || squares[static_cast<Eigen::Index>(t)] > 0);
      if (!is_positive) continue;
      const double distance = (weights.array() * (unit_ * squares - measured_).array().square()).sum();
      if (distance >= best) continue;
      best = distance;
      next.active = set;
      next.squares = squares;
    }
    if (!std::isfinite(best)) return AllanSolution{};
    next.model = unit_ * next.squares;
    next.noise = next.model - unit_.col(4) * next.squares[4];
    if ((next.active & ~ramp_bit) == 0) next.noise = 1e-6 * next.model;
    const double change = ((next.model - solution.model).array() / solution.model.array()).abs().maxCoeff();
    solution = next;
    if (change < 1e-6) break;
  }
  return solution;
}

void AllanSolver::choose_misfit() {
  const auto excess = [&](double misfit) {
    misfit_ = misfit;
    const AllanSolution s = solve(all_terms);
    if (s.active == 0) return 0.0;
    const double freedom = static_cast<double>(measured_.size()) - std::popcount(s.active);
    return deviance(s) / std::max(1.0, freedom);
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
ArrayXd AllanSolver::density(const AllanSolution& solution) const {
  const ArrayXd omega = 2 * std::numbers::pi * frequency_;
  const VectorXd& q = solution.squares;
  return 4 * q[0] / period_ * (omega * (period_ / 2)).sin().square() + q[1] + q[2] * flicker_density_ / omega +
         q[3] / omega.square();
}

AllanSolver::Estimate AllanSolver::estimate(std::size_t term, const AllanSolution& solution) const {
  // The estimate is a sum of the measured variances with the weights `c`, a row of the pseudo-inverse.
  std::vector<Eigen::Index> columns = {static_cast<Eigen::Index>(term)};
  for (std::size_t t = 0; t < allan_term_count; ++t)
    if (t != term && contains(solution.active, t)) columns.push_back(static_cast<Eigen::Index>(t));
  const VectorXd weights = solution.uncertainty.cwiseInverse();
  MatrixXd design = unit_(Eigen::all, columns);
  // The band of the flicker is one more parameter, if the band has an effect. Its prior is the range of possible
  // bands.
  const bool has_band =
      contains(solution.active, flicker_column) && flicker_change_.size() > 0 && !flicker_change_.isZero(0);
  if (has_band) {
    design.conservativeResize(Eigen::NoChange, design.cols() + 1);
    design.rightCols(1) = flicker_change_ * solution.squares[flicker_column];
  }
  const MatrixXd x = weights.cwiseSqrt().asDiagonal() * design;
  const VectorXd scale = x.colwise().norm().cwiseInverse();
  const MatrixXd scaled = x * scale.asDiagonal();
  VectorXd first = VectorXd::Zero(scaled.cols());
  first[0] = 1;
  MatrixXd normal = scaled.transpose() * scaled;
  double known = 0;  // the weight of what is known beforehand
  if (has_band) {
    known = 12 / std::pow(std::log(last_band_ / first_band_), 2) * std::pow(scale.tail(1)[0], 2);
    normal.bottomRightCorner(1, 1).array() += known;
  }
  const VectorXd row = normal.ldlt().solve(first);
  const VectorXd c = scale[0] * weights.cwiseSqrt().cwiseProduct(scaled * row);

  // Averages over a time T of squares of filtered noise have, with the gain G of the sum and the density S, the
  // cumulants 2/T int G^2 S^2 df and 8/T^2 int G^3 S^3 df over all f. At long averaging times fewer terms than T/tau
  // count, which the degrees of freedom know: they scale each point.
  const ArrayXd S = density(solution);
  Estimate estimate;
  estimate.square = c.dot(measured_);
  if ((solution.active & ~ramp_bit) == 0) {
    estimate.variance = c.array().square().matrix().dot(solution.uncertainty);
    return estimate;
  }
  VectorXd scaled_c = c;
  for (Eigen::Index i = 0; i < c.size(); ++i) {
    const double asymptotic = 4 / length_ * ((gain_.col(i).array() * S).square() * step_).sum();
    const double scatter = solution.uncertainty[i] - std::pow(misfit_ * solution.model[i], 2);
    scaled_c[i] *= std::sqrt(std::max(0.0, scatter) / asymptotic);
  }
  const auto second = [&](const VectorXd& w) {
    return 4 / length_ * (((gain_ * w).array() * S).square() * step_).sum();
  };
  const double plain = second(c), true_second = second(scaled_c);
  const double third = 16 / (length_ * length_) * (((gain_ * scaled_c).array() * S).cube() * step_).sum();
  if (has_band) estimate.variance = known * std::pow(scale[0] * row.tail(1)[0], 2);
  estimate.variance += true_second + misfit_ * misfit_ * (c.array() * solution.model.array()).square().sum();
  estimate.skewness =
      true_second > 0 ? third / std::pow(estimate.variance, 1.5) * std::sqrt(std::max(1.0, true_second / plain)) : 0;
  return estimate;
}

}  // namespace imud
