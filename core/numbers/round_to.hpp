// Rounding to the digits of a sensor.
#pragma once

#include <cmath>

namespace imud {

// Returns the multiple of `lsb`, above 0, that is nearest to `value`; the greater one if two are equally near.
inline double round_to(double value, double lsb) noexcept { return lsb * std::floor(value / lsb + 0.5); }

}  // namespace imud
