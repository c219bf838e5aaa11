// Keys: the ranges, units and defaults of keys that the configuration and the control protocol read, as data.
#pragma once

#include <string_view>

#include "core/timeline.hpp"

namespace imud {

// A number of the configuration. Its unit is a part of the key.
struct NumberKey {
  std::string_view path;  // "truth.delay_ms"
  double si;              // SI = si * number
  double min, max, fallback = 0;
  constexpr std::string_view key() const { return path.substr(path.rfind('.') + 1); }
};

namespace keys {

inline constexpr double largest = 1e9;  // of a sensor's errors, in any unit

inline constexpr NumberKey delay{"truth.delay_ms", 1e-3, 0, 1000};
inline constexpr std::string_view automatic = "auto";  // in place of the delay
inline constexpr NumberKey automatic_percent{"truth.auto_delay_percent", 1, 50, 100, 99};
inline constexpr NumberKey extrapolate{"truth.extrapolate_ms", 1e-3, 0, 10'000,
                                       static_cast<double>(Timeline::Limits{}.extrapolate.count()) / 1e6};

}  // namespace keys

}  // namespace imud
