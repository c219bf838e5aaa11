// PoseFit: the noise of the truths, and truths that are off by more.
#include <algorithm>
#include <cmath>

#include "core/attitude.hpp"
#include "core/pose_fit.hpp"
#include "core/pose_noise.hpp"

namespace imud {

// Returns the attitude, position or velocity of number `i` relative to that of `origin`: rad, m, m/s.
Vector3 PoseFit::value_of(Quantity quantity, std::size_t origin, std::size_t i) const noexcept {
  const Truth &at = item(i).truth, &from = item(origin).truth;
  if (quantity == attitude) return log(from.q_NB.normalized().conjugate() * at.q_NB.normalized());
  return at.has_velocity ? Vector3(at.v_BN_N - from.v_BN_N) : Vector3(at.r_BN_N - from.r_BN_N);
}

double PoseFit::size_of(Quantity quantity, std::size_t i) const noexcept {
  if (quantity == attitude) return 0.0;
  const Truth& truth = item(i).truth;
  return truth.has_velocity ? truth.v_BN_N.norm() : truth.r_BN_N.norm();
}

// Number `i` has three neighbours or more on either side among the ten truths from `first`.
bool PoseFit::is_outlier(Quantity quantity, std::size_t first, std::size_t i, double& distance,
                         double& bound) const noexcept {
  constexpr std::size_t count = 10, enough = 20;
  constexpr double widest_turn = 2.0;  // rad, of the neighbours
  constexpr double least_distance = 2e-3, resolution = 0x1p-21;
  const std::size_t origin = i - 1;
  std::array<double, count> times_s{};
  std::array<Vector3, count> values;
  for (std::size_t k = 0; k < count; ++k) {
    times_s[k] = seconds(item(first + k).truth.time - item(i).truth.time);
    values[k] = value_of(quantity, origin, first + k);
    if (quantity == attitude && first + k != i && values[k].squaredNorm() > widest_turn * widest_turn) return false;
  }
  const DeletedResidual test = deleted_residual(times_s, values, i - first);
  const Tally& tally = tallies_[quantity];
  const bool knows_noise = tally.noises >= enough;
  bound = std::max(least_distance, resolution * size_of(quantity, i));
  if (knows_noise) bound = std::max(bound, 10.0 * std::sqrt(test.variance * tally.recent));
  distance = test.distance;
  return test.ratio > (knows_noise ? 150.0 : 1500.0) && distance > bound;
}

// Removes the fourth truth from the newest if it is an outlier; in a segment of ten truths, one of those with three
// neighbours on either side. Returns whether there was one.
bool PoseFit::refuse_outlier() noexcept {
  constexpr std::size_t window = 10, beside = 3;
  const std::size_t length = count_ - newest_segment_;
  if (length < window) return false;
  const std::size_t first = count_ - window;
  for (std::size_t i = length == window ? first + beside : count_ - 1 - beside; i + beside < count_; ++i) {
    Outliers found = outliers_;
    const bool turns = item(i).derives_rate && is_outlier(attitude, first, i, found.angle, found.angle_bound);
    const bool moves = item(i).derives_force && is_outlier(place, first, i, found.distance, found.distance_bound);
    if (i < next_ || (!turns && !moves)) continue;
    if (!turns) found.angle = 0;
    if (!moves) found.distance = 0;
    found.time = item(i).truth.time;
    ++found.count;
    outliers_ = found;
    for (; i + 1 < count_; ++i) items_[(oldest_ + i) % capacity] = items_[(oldest_ + i + 1) % capacity];
    --count_;
    return true;
  }
  return false;
}

// Estimates the noise around the newest truth whose four neighbours on either side have been tested.
void PoseFit::estimate_noise() noexcept {
  constexpr std::size_t untested = 3, beside = 4;
  constexpr double widest_turn = 2.0, share = 0.01;
  if (count_ - newest_segment_ < untested + 2 * beside + 1) return;
  const std::size_t i = count_ - 1 - untested - beside;
  Item& middle = items_[(oldest_ + i) % capacity];
  std::array<double, 2 * beside + 1> times_s{};
  for (std::size_t k = 0; k < times_s.size(); ++k)
    times_s[k] = seconds(item(i + k - beside).truth.time - middle.truth.time);
  for (const Quantity quantity : quantities) {
    if (!middle.derives(quantity)) continue;
    std::array<Vector3, 2 * beside + 1> values;
    for (std::size_t k = 0; k < values.size(); ++k) values[k] = value_of(quantity, i, i + k - beside);
    const auto is_wide = [](const Vector3& phi) { return phi.squaredNorm() > widest_turn * widest_turn; };
    if (quantity == attitude && std::any_of(values.begin(), values.end(), is_wide)) continue;
    Tally& tally = tallies_[quantity];
    const double energy = middle.noise[quantity] = noise_energy(times_s, values);
    tally.noise += energy;
    ++tally.noises;
    tally.recent += std::max(share, 1.0 / static_cast<double>(tally.noises)) * (energy - tally.recent);
  }
}

}  // namespace imud
