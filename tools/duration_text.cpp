#include "tools/duration_text.hpp"

#include <fmt/format.h>

namespace imud {

std::string percentiles_text(const DurationHistogram& durations) {
  return fmt::format("p50 {}, p99 {}, max {}", duration_text(durations.percentile(50)),
                     duration_text(durations.percentile(99)), duration_text(durations.max()));
}

std::string duration_text(double seconds) {
  if (seconds < 999.5e-6) return fmt::format("{:.3g} us", seconds * 1e6);
  if (seconds < 999.5e-3) return fmt::format("{:.3g} ms", seconds * 1e3);
  return seconds < 999.5 ? fmt::format("{:.3g} s", seconds) : fmt::format("{:.0f} s", seconds);
}

}  // namespace imud
