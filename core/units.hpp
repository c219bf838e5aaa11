// Units: the factors from the units of configurations, data sheets and simulators to SI. They are defined nowhere
// else.
#pragma once

namespace imud::units {

inline constexpr double pi = 3.141592653589793;
inline constexpr double degree = pi / 180.0;         // rad
inline constexpr double foot = 0.3048;               // m, exact
inline constexpr double gauss = 1e-4;                // T
inline constexpr double standard_gravity = 9.80665;  // m/s^2, exact
inline constexpr double earth_rate = 7.292115e-5;    // rad/s, WGS 84

// The ellipsoid of WGS 84 (NGA.STND.0036, table 3.1).
namespace wgs84 {
inline constexpr double a = 6'378'137.0, f = 1.0 / 298.257223563, b = a * (1.0 - f);  // m, m/m, m
}

}  // namespace imud::units
