// piecewise_linear: a curve by its points.
#pragma once

#include <algorithm>
#include <cstddef>
#include <span>

namespace imud {

// Returns the value at `x` of the curve through the points (at[i], value[i]): linear between them, constant before
// the first and after the last. `at` must ascend and not be empty; `value` must be as long.
inline double piecewise_linear(std::span<const double> at, std::span<const double> value, double x) noexcept {
  const auto next = static_cast<std::size_t>(std::upper_bound(at.begin(), at.end(), x) - at.begin());
  if (next == 0) return value.front();
  if (next == at.size()) return value.back();
  return value[next - 1] + (x - at[next - 1]) / (at[next] - at[next - 1]) * (value[next] - value[next - 1]);
}

}  // namespace imud
