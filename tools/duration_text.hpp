// Durations as people read them.
#pragma once

#include <string>

#include "core/duration_histogram.hpp"

namespace imud {

// "p50 12 us, p99 80 us, max 400 us"
std::string percentiles_text(const DurationHistogram& durations);

// "12 us", "1.25 ms", "3.5 s": three digits.
std::string duration_text(double seconds);

}  // namespace imud
