// PoseFit: the noise of the truths, and the outliers.
#include <algorithm>
#include <cmath>
#include <span>

#include "core/attitude.hpp"
#include "core/pose/pose_fit.hpp"
#include "core/pose/pose_noise.hpp"

namespace imud {

// Returns the attitude, position or velocity of item `i` relative to item `origin`: rad, m, m/s.
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

// Tests `group` among its nine nearest neighbours in the segment from `begin` to `end`, at most six of them before.
// Sets `suspect` if the group is off by more than noise and motion explain, and more clearly than the suspect before.
void PoseFit::test(Quantity quantity, const Group& group, std::size_t begin, std::size_t end,
                   Suspect& suspect) const noexcept {
  constexpr std::size_t others = 9, most_before = 6, few = 2, enough = 20;
  constexpr double widest_turn = 2.0;  // rad, of the neighbours
  constexpr double least_distance = 2e-3, resolution = 0x1p-21, clear = 150.0, clearest = 1500.0, far_above = 3.0;
  const std::size_t behind = end - group.first - group.count;
  const std::size_t before = std::min(group.first - begin, std::max(most_before, others - std::min(others, behind)));
  const std::size_t after = others - before, size = others + group.count;
  if (after > behind) return;
  const std::size_t first = group.first - before;
  const std::size_t origin = before > 0 ? group.first - 1 : group.first + group.count;
  std::array<double, others + longest_run> times_s{};
  std::array<Vector3, others + longest_run> values;
  const auto is_tested = [&](std::size_t k) { return k >= before && k < before + group.count; };
  for (std::size_t k = 0; k < size; ++k) {
    times_s[k] = seconds(item(first + k).truth.time - item(group.first).truth.time);
    values[k] = value_of(quantity, origin, first + k);
    if (quantity == attitude && !is_tested(k) && values[k].squaredNorm() > widest_turn * widest_turn) return;
  }
  const DeletedResidual test =
      deleted_residual(std::span(times_s).first(size), std::span(values).first(size), before, group.count);
  const Tally& tally = tallies_[quantity];
  const bool knows_noise = tally.noises >= enough, is_inside = before >= few && after >= few;
  double bound = std::max(least_distance, resolution * size_of(quantity, group.first));
  if (knows_noise) bound = std::max(bound, 10.0 * std::sqrt(test.variance * tally.recent));
  if (!is_inside) {
    // A motion that begins here has no neighbours that show it.
    double step = 0.0;
    for (std::size_t k = 1; k < size; ++k)
      if (!is_tested(k - 1) && !is_tested(k)) step = std::max(step, (values[k] - values[k - 1]).norm());
    const auto is_steep = [&](std::size_t k) { return (values[k] - values[k - 1]).norm() > far_above * step; };
    if ((before > 0 && !is_steep(before)) || (after > 0 && !is_steep(before + group.count))) return;
    const double span_s =
        before < few ? times_s[before + group.count] : times_s[size - after - 1] - times_s[before - 1];
    bound = std::max(bound, explained(quantity, item(group.first).truth.has_velocity, span_s));
  }
  const double least_ratio = knows_noise && is_inside ? clear : clearest;
  if (test.ratio > least_ratio && test.distance > bound && test.ratio > suspect.ratio)
    suspect = {test.ratio, test.distance, bound, quantity, group};
}

// Returns the greatest deviation from its motion that a vehicle reaches within the time by accelerating: rad, m, m/s.
double PoseFit::explained(Quantity quantity, bool is_velocity, double span_s) noexcept {
  constexpr double most_angular = 1000.0, most_linear = 200.0;  // rad/s^2, m/s^2
  if (quantity == place && is_velocity) return most_linear * span_s;
  return 0.5 * (quantity == attitude ? most_angular : most_linear) * span_s * span_s;
}

// Removes the clearest outlier group of the segment from `begin` to `end`. Only groups whose last truth is at `from`
// or later, and before `to`, are tested. Truths that next() has taken remain. Returns true if a group was removed.
bool PoseFit::refuse_outliers(std::size_t begin, std::size_t end, std::size_t from, std::size_t to) noexcept {
  Suspect suspect;
  for (std::size_t last = std::max(from, begin); last < to; ++last)
    for (std::size_t count = 1; count <= longest_run && begin + count <= last + 1; ++count) {
      const Group group{last + 1 - count, count};
      if (last < next_) continue;
      if (item(last).derives_rate) test(attitude, group, begin, end, suspect);
      if (item(last).derives_force) test(place, group, begin, end, suspect);
    }
  if (suspect.group.count == 0) return false;
  const std::size_t after = suspect.group.first + suspect.group.count;
  const std::size_t removed = after - std::max(suspect.group.first, next_);
  if (after - removed == begin) {
    Item& now_first = items_[(oldest_ + after) % capacity];
    const Item& was_first = item(begin);
    now_first.begins_segment = true;
    now_first.truth.new_run = was_first.truth.new_run;
    now_first.truth.follows_gap = was_first.truth.follows_gap;
  }
  outliers_.count += removed;
  outliers_.time = item(after - 1).truth.time;
  const bool turns = suspect.quantity == attitude;
  (turns ? outliers_.angle : outliers_.distance) = suspect.distance;
  (turns ? outliers_.distance : outliers_.angle) = 0.0;
  (turns ? outliers_.angle_bound : outliers_.distance_bound) = suspect.bound;
  // The item at index count_ has the truth that push() is adding.
  for (std::size_t i = after; i <= count_; ++i)
    items_[(oldest_ + i - removed) % capacity] = items_[(oldest_ + i) % capacity];
  count_ -= removed;
  return true;
}

// Tests the groups whose third later neighbour is the newest truth. The first groups of a segment are tested when the
// segment has 13 truths.
bool PoseFit::refuse_outliers() noexcept {
  constexpr std::size_t first_test = 13, beside = 3;
  const std::size_t length = count_ - newest_segment_;
  if (length < first_test) return false;
  const std::size_t from = length == first_test ? newest_segment_ : count_ - 1 - beside;
  return refuse_outliers(newest_segment_, count_, from, count_ - beside);
}

// Tests the groups of the newest segment, which has ended, that have fewer than three later neighbours.
void PoseFit::refuse_outliers_at_end() noexcept {
  constexpr std::size_t first_test = 13, beside = 3;
  for (std::size_t i = 0; i < longest_run; ++i) {
    const bool is_tested = count_ - newest_segment_ >= first_test;
    if (!refuse_outliers(newest_segment_, count_, is_tested ? count_ - beside : newest_segment_, count_)) return;
  }
}

// Estimates the noise around the newest truth whose four neighbours on either side have been tested.
void PoseFit::estimate_noise() noexcept {
  constexpr std::size_t untested = 2 + longest_run, beside = 4;
  constexpr double widest_turn = 2.0, share = 0.01;
  if (count_ - newest_segment_ < untested + 2 * beside + 1) return;
  const std::size_t i = count_ - 1 - untested - beside;
  Item& middle = items_[(oldest_ + i) % capacity];
  std::array<double, 2 * beside + 1> times_s{};
  for (std::size_t k = 0; k < times_s.size(); ++k)
    times_s[k] = seconds(item(i + k - beside).truth.time - middle.truth.time);
  for (const Quantity quantity : quantities) {
    if (!middle.derives(quantity) || middle.noise[quantity] >= 0.0) continue;
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
