// duration_text: durations as text for people.
#pragma once

#include <string>

#include "core/numbers/duration_histogram.hpp"

namespace imud {

// Returns the percentiles: "p50 12 us, p99 80 us, max 400 us".
std::string percentiles_text(const DurationHistogram& durations);

// Returns the duration with three digits: "12 us", "1.25 ms", "3.5 s".
std::string duration_text(double seconds);

}  // namespace imud
