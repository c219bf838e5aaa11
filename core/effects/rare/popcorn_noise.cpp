#include "core/effects/rare/popcorn_noise.hpp"

#include "core/numbers/elementary.hpp"

namespace imud {

PopcornNoise::PopcornNoise(const TriadErrors& errors, Quantity quantity, double period_s)
    : level_(errors.popcorn_noise),
      time_s_(errors.popcorn_time),
      period_s_(period_s),
      quantity_(quantity),
      on_(!errors.popcorn_noise.isZero(0.0)) {}

// Returns a deviate that is uniform in (0, 1).
double PopcornNoise::drawn(const Normals& normals, int axis, std::uint64_t number) const noexcept {
  return normals.uniform(quantity_, Process::popcorn_noise, 3 * number + static_cast<std::uint64_t>(axis));
}

void PopcornNoise::begin(const Normals& normals) noexcept {
  for (int axis = 0; axis < 3; ++axis) {
    Level& level = levels_[static_cast<std::size_t>(axis)];
    level.sign = drawn(normals, axis, 0) < 0.5 ? -1 : 1;
    level.number = 1;
    level.until_s = -time_s_[axis] * elementary::log(drawn(normals, axis, 1));
  }
  has_begun_ = true;
}

// Returns the mean of s from `from_s` to `to_s`, which is later. The next call must begin at `to_s`.
double PopcornNoise::mean(const Normals& normals, int axis, double from_s, double to_s) noexcept {
  Level& level = levels_[static_cast<std::size_t>(axis)];
  double sum = 0, time_s = from_s;
  while (level.until_s < to_s) {
    sum += level.sign * (level.until_s - time_s);
    time_s = level.until_s;
    level.sign = -level.sign;
    level.until_s -= time_s_[axis] * elementary::log(drawn(normals, axis, ++level.number));
  }
  return (sum + level.sign * (to_s - time_s)) / (to_s - from_s);
}

PopcornNoise::Value PopcornNoise::next(const Normals& normals, std::uint64_t k) noexcept {
  if (!has_begun_) begin(normals);
  const double to_s = static_cast<double>(static_cast<std::int64_t>(k)) * period_s_;
  Value value;
  for (int axis = 0; axis < 3; ++axis) {
    const double sign = level_[axis] * levels_[static_cast<std::size_t>(axis)].sign;
    value.mean[axis] = k == 0 ? sign : level_[axis] * mean(normals, axis, to_s - period_s_, to_s);
    value.now[axis] = level_[axis] * levels_[static_cast<std::size_t>(axis)].sign;
  }
  return value;
}

void PopcornNoise::seek(const Normals& normals, std::uint64_t k) noexcept {
  if (!on_) return;
  begin(normals);
  if (k < 2) return;
  const double to_s = static_cast<double>(static_cast<std::int64_t>(k - 1)) * period_s_;
  for (int axis = 0; axis < 3; ++axis) mean(normals, axis, 0, to_s);
}

void PopcornNoise::continue_from(const PopcornNoise& before, const Normals& normals, std::uint64_t k) noexcept {
  if (!on_) return;
  if (!before.has_begun_) return seek(normals, k);
  // The time of sample k is different if the rate is different.
  const double shift_s = static_cast<double>(static_cast<std::int64_t>(k)) * (period_s_ - before.period_s_);
  levels_ = before.levels_;
  for (Level& level : levels_) level.until_s += shift_s;
  has_begun_ = true;
}

}  // namespace imud
