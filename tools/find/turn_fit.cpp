#include "tools/find/turn_fit.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

namespace imud {
namespace {

constexpr double most_deviation = 0.08;  // of the norm
constexpr double least_spread_rad = 0.2;
constexpr std::size_t fewest_windows = 20;
constexpr double least_explained = 0.9;
constexpr double window_turn = 0.35;    // rad
constexpr double least_turn = 0.1;      // rad, of a window
constexpr double observed_sigma = 0.1;  // relative
constexpr double most_unlike = 0.05;    // scales of one gyro's axes, beyond their uncertainty

using Matrix9 = Eigen::Matrix<double, 9, 9>;
using Vector9 = Eigen::Matrix<double, 9, 1>;

struct Vectors {
  std::array<std::span<const double>, 3> components;
  Vector3 at(std::size_t k) const { return {components[0][k], components[1][k], components[2][k]}; }
  std::size_t size() const { return components[0].size(); }
};

Vectors blocks_of(const HandledFrames& frames, const VectorPlace& place, Handled capture) {
  return {{frames.blocks(place.component(0), capture), frames.blocks(place.component(1), capture),
           frames.blocks(place.component(2), capture)}};
}

// The scales for one pairing of axes: component j is about axis[j].
struct Pairing {
  std::array<std::size_t, 3> axis;
  Vector3 scale = Vector3::Zero(), variance = Vector3::Constant(1e300);  // of a residual variance of 1
  double squares = 0;                                                    // of the residuals
};

Pairing solve(const std::array<std::size_t, 3>& axis, const Matrix9& normal, const Vector9& right, double all) {
  Pairing pairing{axis};
  // Components that do not move at all are left out.
  std::vector<std::size_t> used;
  double largest = 0;
  for (std::size_t j = 0; j < 3; ++j) {
    const auto at = static_cast<Eigen::Index>(3 * j + axis[j]);
    largest = std::max(largest, normal(at, at));
  }
  for (std::size_t j = 0; j < 3; ++j) {
    const auto at = static_cast<Eigen::Index>(3 * j + axis[j]);
    if (normal(at, at) > 1e-9 * largest) used.push_back(j);
  }
  const auto count = static_cast<Eigen::Index>(used.size());
  Eigen::MatrixXd part(count, count);
  Eigen::VectorXd side(count);
  const auto place = [&](Eigen::Index i) {
    const std::size_t j = used[static_cast<std::size_t>(i)];
    return static_cast<Eigen::Index>(3 * j + axis[j]);
  };
  for (Eigen::Index i = 0; i < count; ++i) {
    side(i) = right(place(i));
    for (Eigen::Index k = 0; k < count; ++k) part(i, k) = normal(place(i), place(k));
  }
  const Eigen::MatrixXd inverse = part.completeOrthogonalDecomposition().pseudoInverse();
  const Eigen::VectorXd solution = inverse * side;
  pairing.squares = std::max(0.0, all - solution.dot(side));
  for (Eigen::Index i = 0; i < count; ++i) {
    const auto j = static_cast<Eigen::Index>(used[static_cast<std::size_t>(i)]);
    pairing.scale(j) = solution(i);
    pairing.variance(j) = inverse(i, i);
  }
  return pairing;
}

// Computes one scale for all components from the components whose scale is observed. Returns false if these scales
// differ.
bool find_common(TurnFound& found) {
  double sum = 0, weights = 0;
  for (std::size_t j = 0; j < 3; ++j) {
    if (!found.is_observed[j]) continue;
    const double weight = 1 / (found.sigma[j] * found.sigma[j]);
    sum += weight * std::abs(found.scale[j]);
    weights += weight;
  }
  if (weights == 0) return false;
  found.common = sum / weights;
  found.common_sigma = std::sqrt(1 / weights);
  constexpr double sigmas = 5;
  for (std::size_t j = 0; j < 3; ++j)
    if (found.is_observed[j] &&
        std::abs(std::abs(found.scale[j]) - found.common) > sigmas * found.sigma[j] + most_unlike * found.common)
      return false;
  return true;
}

}  // namespace

std::optional<GravityFit> fit_gravity(const HandledFrames& frames, const VectorPlace& place) {
  const Vectors rest = blocks_of(frames, place, Handled::rest), turned = blocks_of(frames, place, Handled::turned);
  if (rest.size() == 0 || turned.size() == 0) return std::nullopt;
  Vector3 mean = Vector3::Zero();
  for (std::size_t k = 0; k < rest.size(); ++k) mean += rest.at(k) / static_cast<double>(rest.size());
  GravityFit fit;
  fit.norm = mean.norm();
  if (!(fit.norm > 0)) return std::nullopt;
  double squares = 0;
  Vector3 middle = Vector3::Zero();
  for (std::size_t k = 0; k < turned.size(); ++k) {
    const Vector3 one = turned.at(k);
    const double relative = one.norm() / fit.norm - 1;
    squares += relative * relative;
    fit.change += relative / static_cast<double>(turned.size());
    fit.up.push_back(one.norm() > 0 ? Vector3(one.normalized()) : Vector3(Vector3::Zero()));
    middle += fit.up.back();
  }
  const auto count = static_cast<double>(turned.size());
  fit.deviation = std::sqrt(squares / count);
  fit.spread_rad = std::sqrt(std::max(0.0, 1 - (middle / count).squaredNorm()));
  if (!(fit.deviation < most_deviation) || fit.spread_rad < least_spread_rad) return std::nullopt;
  constexpr std::size_t most_values = 4096;
  std::array<std::vector<double>, 3> values;
  for (std::size_t i = 0; i < 3; ++i) values[i] = frames.values(place.component(i), Handled::rest, most_values);
  for (std::size_t k = 0; k < values[0].size(); ++k) {
    const double relative = Vector3(values[0][k], values[1][k], values[2][k]).norm() / fit.norm - 1;
    fit.sigma += relative * relative / static_cast<double>(values[0].size());
  }
  fit.sigma = std::sqrt(fit.sigma);
  if (fit.sigma > most_deviation) return std::nullopt;
  return fit;
}

TurnFit::TurnFit(const HandledFrames& frames, const GravityFit& gravity) : frames_(frames), up_(gravity.up) {
  const std::vector<double>& time = frames.time(Handled::turned);
  // The shortest windows in which gravity turns by enough, or else as long ones as there are enough of.
  std::size_t blocks = 1;
  for (; up_.size() / (2 * blocks) >= 2 * fewest_windows; blocks *= 2) {
    double squares = 0, count = 0;
    for (std::size_t k = 0; k + blocks < up_.size(); k += blocks, count += 1)
      squares += (up_[k + blocks] - up_[k]).squaredNorm();
    if (count > 0 && squares / count > window_turn * window_turn) break;
  }
  const double mean = up_.size() > 1 ? (time.back() - time.front()) / static_cast<double>(up_.size() - 1) : 1;
  for (std::size_t k = 0; k + blocks < up_.size(); k += blocks)
    // No window has a gap.
    if (time[k + blocks] - time[k] < 1.5 * mean * static_cast<double>(blocks)) windows_.push_back({k, k + blocks});
}

std::optional<TurnFound> TurnFit::fit(const VectorPlace& place) const {
  if (windows_.size() < fewest_windows) return std::nullopt;
  const std::vector<double>& time = frames_.time(Handled::turned);
  const Vectors turned = blocks_of(frames_, place, Handled::turned);
  Vector3 rest = Vector3::Zero();
  for (std::size_t i = 0; i < 3; ++i) {
    const std::vector<double>& still = frames_.blocks(place.component(i), Handled::rest);
    for (const double value : still) rest(static_cast<Eigen::Index>(i)) += value / static_cast<double>(still.size());
  }
  // Unknowns: omega = M r, M's column j at 3 j.
  Matrix9 normal = Matrix9::Zero();
  Vector9 right = Vector9::Zero();
  double all = 0;
  for (const Window& window : windows_) {
    Eigen::Matrix<double, 3, 9> rows = Eigen::Matrix<double, 3, 9>::Zero();
    for (std::size_t k = window.first; k < window.last; ++k)
      for (const std::size_t end : {k, k + 1}) {
        const Vector3 r = (turned.at(end) - rest) * ((time[k + 1] - time[k]) / 2);
        Eigen::Matrix3d cross;  // its column i is u x e_i
        cross << 0, -up_[end].z(), up_[end].y(), up_[end].z(), 0, -up_[end].x(), -up_[end].y(), up_[end].x(), 0;
        for (Eigen::Index j = 0; j < 3; ++j) rows.middleCols<3>(3 * j) += r(j) * cross;
      }
    const Vector3 turn = up_[window.last] - up_[window.first];
    normal += rows.transpose() * rows;
    right += rows.transpose() * turn;
    all += turn.squaredNorm();
  }
  const auto count = static_cast<double>(windows_.size());
  if (all < least_turn * least_turn * count) return std::nullopt;
  std::optional<Pairing> best;
  std::array<std::size_t, 3> axis = {0, 1, 2};
  do {
    const Pairing pairing = solve(axis, normal, right, all);
    if (!best || pairing.squares < best->squares) best = pairing;
  } while (std::ranges::next_permutation(axis).found);
  TurnFound found{best->axis};
  found.windows = windows_.size();
  found.explained = 1 - best->squares / all;
  if (found.explained < least_explained) return std::nullopt;
  // A window has two residuals, because the third would be along u.
  const double variance = best->squares / (2 * count - 3);
  for (std::size_t j = 0; j < 3; ++j) {
    const auto at = static_cast<Eigen::Index>(j);
    found.scale[j] = best->scale(at);
    found.sigma[j] = std::sqrt(variance * best->variance(at));
    found.is_observed[j] = found.scale[j] != 0 && found.sigma[j] < observed_sigma * std::abs(found.scale[j]);
  }
  if (!find_common(found)) return std::nullopt;
  found.bias = found.common * rest.cwiseAbs().maxCoeff();
  return found;
}

// Returns, for each component of `one`, the parallel component of `other`; nullopt if their directions differ.
// `sign`: the sign of each component.
std::optional<std::array<std::size_t, 3>> axes_along(const GravityFit& one, const GravityFit& other,
                                                     std::array<bool, 3>& is_negative) {
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  const std::size_t count = std::min(one.up.size(), other.up.size());
  for (std::size_t k = 0; k < count; ++k) sum += one.up[k] * other.up[k].transpose();
  std::array<std::size_t, 3> axis = {0, 1, 2}, best = axis;
  double most = 0;
  do {
    double total = 0;
    for (std::size_t i = 0; i < 3; ++i)
      total += std::abs(sum(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(axis[i])));
    if (total <= most) continue;
    most = total;
    best = axis;
  } while (std::ranges::next_permutation(axis).found);
  constexpr double along = 0.98;
  if (most < along * static_cast<double>(count)) return std::nullopt;
  for (std::size_t i = 0; i < 3; ++i)
    is_negative[i] = sum(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(best[i])) < 0;
  return best;
}

}  // namespace imud
