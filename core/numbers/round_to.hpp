// Rounding to the digits of a sensor.
#pragma once

#include <cmath>

namespace imud {

// Returns the nearest multiple of `lsb`, which is positive; the greater of two.
inline double round_to(double value, double lsb) noexcept { return lsb * std::floor(value / lsb + 0.5); }

}  // namespace imud
