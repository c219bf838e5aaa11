#include "tools/fit/sensor_fit.hpp"

#include <Eigen/Cholesky>
#include <Eigen/SVD>
#include <algorithm>
#include <boost/math/distributions/chi_squared.hpp>
#include <cmath>

#include "core/effects/flicker.hpp"

namespace imud {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using Index = Eigen::Index;

// Returns the covariance of the means of two dwells due to flicker noise with B = 1.
double flicker_covariance(const DwellMean& a, const DwellMean& b, bool is_same) {
  const TriadErrors band;  // from and to its own averaging times
  const std::size_t count = Flicker::octaves(band.flicker_from_s, band.flicker_to_s);
  double sum = 0, time = Flicker::first_correlation_time(band.flicker_from_s);
  for (std::size_t k = 0; k < count; ++k, time *= 2) {
    const double variance = Flicker::variance(k, count);
    const double x = a.length_s / time, y = b.length_s / time;
    // The mean over a time of exponentially correlated noise, and the product of the means over two times apart.
    if (is_same)
      sum += variance * 2 * (x - 1 + std::exp(-x)) / (x * x);
    else
      sum += variance * std::exp(-std::abs(a.middle_s - b.middle_s) / time + 0.5 * (x + y)) * (1 - std::exp(-x)) / x *
             (1 - std::exp(-y)) / y;
  }
  return sum;
}

MatrixXd covariance(const std::vector<DwellMean>& dwells, int axis, const AllanTerms& noise,
                    const FixtureErrors& fixture) {
  const auto n = static_cast<Index>(dwells.size());
  MatrixXd all = MatrixXd::Zero(n, n);
  for (Index i = 0; i < n; ++i)
    for (Index j = 0; j <= i; ++j) {
      const DwellMean &a = dwells[static_cast<std::size_t>(i)], &b = dwells[static_cast<std::size_t>(j)];
      double& c = all(i, j);
      if (noise.B > 0) c += noise.B * noise.B * flicker_covariance(a, b, i == j);
      // A random walk that begins with the first dwell; the mean over a time T varies by K^2 T/3.
      const double since = dwells.front().middle_s - 0.5 * dwells.front().length_s;
      const double walked = i == j ? a.middle_s - since - a.length_s / 6 : b.middle_s - since;
      if (noise.K > 0) c += noise.K * noise.K * walked;
      if (i == j) {
        const double across = a.input.squaredNorm() - a.input[axis] * a.input[axis];
        c += a.white[axis] + fixture.angle_rad * fixture.angle_rad * across;
      }
      all(j, i) = c;
    }
  return all;
}

MatrixXd design(const std::vector<DwellMean>& dwells, const Vector3& row, bool has_g_sensitivity) {
  MatrixXd all = MatrixXd::Zero(static_cast<Index>(dwells.size()), fit_terms);
  for (Index i = 0; i < all.rows(); ++i) {
    const DwellMean& dwell = dwells[static_cast<std::size_t>(i)];
    all(i, 0) = 1;
    for (int j = 0; j < 3; ++j) all(i, 1 + j) = dwell.input[j];
    for (int j = 0; j < 3 && has_g_sensitivity; ++j) all(i, 4 + j) = dwell.force[j];
    all(i, 7) = dwell.temperature;
    all(i, 8) = dwell.temperature * row.dot(dwell.input);
  }
  return all;
}

MatrixXd scaled(const MatrixXd& whitened, const std::vector<Index>& terms) {
  MatrixXd all = whitened(Eigen::all, terms);
  all.colwise().normalize();
  return all;
}

// Terms of which the dwells determine the shown ones. A term is hidden if a combination of terms without effect
// contains it: the singular value of the combination is at most `no_effect` of the largest one.
struct Observability {
  std::vector<Index> shown, hidden;
  std::size_t rank = 0;
};

Observability observability(const MatrixXd& whitened, const std::vector<Index>& terms, double no_effect) {
  constexpr double part = 1e-4;
  Observability result;
  if (terms.empty()) return result;
  const MatrixXd all = scaled(whitened, terms);
  const Eigen::JacobiSVD<MatrixXd> svd(all, Eigen::ComputeFullV);
  VectorXd singular = VectorXd::Zero(all.cols());
  singular.head(svd.singularValues().size()) = svd.singularValues();
  for (Index t = 0; t < all.cols(); ++t) {
    bool is_hidden = false;
    for (Index k = 0; k < all.cols(); ++k)
      is_hidden = is_hidden || (singular[k] <= no_effect * singular[0] && std::abs(svd.matrixV()(t, k)) > part);
    (is_hidden ? result.hidden : result.shown).push_back(terms[static_cast<std::size_t>(t)]);
  }
  result.rank = static_cast<std::size_t>((singular.array() > no_effect * singular[0]).count());
  return result;
}

// Returns the observability of the terms. A change with temperature that hides another term, or leaves little of the
// term, is omitted: where all turns are at one temperature, the scale factor at this temperature is known, and its
// change is not.
Observability observability_of_model(const MatrixXd& whitened, std::vector<Index> terms) {
  constexpr double by_rounding = 1e-7, nearly = 1e-3;
  for (const Index change : {8, 7}) {
    const std::vector<Index> hidden = observability(whitened, terms, nearly).hidden;
    if (std::ranges::count(hidden, change) > 0 && hidden.front() < 7) std::erase(terms, change);
  }
  return observability(whitened, terms, by_rounding);
}

// `row`: row i of M, by which the scale factor's change with temperature acts.
AxisFit fit_axis(const std::vector<DwellMean>& dwells, int axis, const Vector3& row, const AllanTerms& noise,
                 const FixtureErrors& fixture, bool has_g_sensitivity) {
  AxisFit fit;
  fit.parameters[static_cast<std::size_t>(1 + axis)].value = 1;  // what is not fitted is nominal
  const Eigen::LLT<MatrixXd> root(covariance(dwells, axis, noise, fixture));
  const MatrixXd terms = design(dwells, row, has_g_sensitivity);
  const MatrixXd whitened = root.matrixL().solve(terms);
  VectorXd means(static_cast<Index>(dwells.size()));
  for (Index i = 0; i < means.size(); ++i) means[i] = dwells[static_cast<std::size_t>(i)].mean[axis];

  std::vector<Index> varied;
  for (Index t = 0; t < whitened.cols(); ++t)
    if (whitened.col(t).norm() > 0) varied.push_back(t);
  fit.wanted = varied.size();
  const auto [shown, hidden, rank] = observability_of_model(whitened, varied);
  fit.rank = rank;
  if (shown.empty()) return fit;

  VectorXd rest = means;
  for (std::size_t t = 0; t < fit_terms; ++t) rest -= fit.parameters[t].value * terms.col(static_cast<Index>(t));
  rest = root.matrixL().solve(rest);
  const MatrixXd x = scaled(whitened, shown);
  const Eigen::JacobiSVD<MatrixXd> solved(x, Eigen::ComputeThinU | Eigen::ComputeThinV);
  const VectorXd steps = solved.solve(rest);
  const VectorXd& s = solved.singularValues();
  fit.condition = s[0] / s[s.size() - 1];
  fit.chi_square = (rest - x * steps).squaredNorm();
  fit.degrees = dwells.size() - shown.size();
  if (fit.degrees > 0) {
    const boost::math::chi_squared distribution(static_cast<double>(fit.degrees));
    if (cdf(complement(distribution, fit.chi_square)) < 1e-3)
      fit.error_factor = std::sqrt(fit.chi_square / static_cast<double>(fit.degrees));
  }
  for (Index k = 0; k < x.cols(); ++k) {
    const Index term = shown[static_cast<std::size_t>(k)];
    const double length = whitened.col(term).norm();
    AxisFit::Parameter& parameter = fit.parameters[static_cast<std::size_t>(term)];
    parameter.value += steps[k] / length;
    const double error = fit.error_factor * (solved.matrixV().row(k).array() / s.transpose().array()).matrix().norm();
    const double scale = term >= 1 && term <= 3 ? fixture.scale * parameter.value : 0;
    parameter.sigma = std::hypot(error / length, scale);
  }
  return fit;
}

}  // namespace

std::array<AxisFit, 3> fit_sensor(const std::vector<DwellMean>& dwells, const std::array<AllanTerms, 3>& noise,
                                  const FixtureErrors& fixture, bool has_g_sensitivity) {
  std::array<AxisFit, 3> fits;
  for (int axis = 0; axis < 3; ++axis) {
    const auto i = static_cast<std::size_t>(axis);
    fits[i] = fit_axis(dwells, axis, Vector3::Unit(axis), noise[i], fixture, has_g_sensitivity);
    if (!fits[i][FitTerm::scale_by_temperature].sigma) continue;
    const Vector3 row(fits[i][FitTerm::x].value, fits[i][FitTerm::y].value, fits[i][FitTerm::z].value);
    fits[i] = fit_axis(dwells, axis, row, noise[i], fixture, has_g_sensitivity);
  }
  return fits;
}

}  // namespace imud
