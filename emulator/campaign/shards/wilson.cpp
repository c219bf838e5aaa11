#include "emulator/campaign/shards/wilson.hpp"

#include <cmath>

#include "core/numbers/random.hpp"

namespace imud {

Interval wilson_interval(std::uint64_t passes, std::uint64_t runs, double confidence) noexcept {
  if (runs == 0) return {};
  const double z = inverse_normal_cdf((1 + confidence) / 2);
  const auto k = static_cast<double>(passes), n = static_cast<double>(runs);
  const double center = (k + z * z / 2) / (n + z * z);
  const double half = z / (n + z * z) * std::sqrt(k * (n - k) / n + z * z / 4);
  // Rounding must not move a bound that is exactly 0 or 1.
  return {passes == 0 ? 0 : center - half, passes == runs ? 1 : center + half};
}

}  // namespace imud
