// A made-up constellation of GPS for tests: 24 satellites in six planes.
#pragma once

#include <cstdint>
#include <vector>

#include "core/gnss/almanac.hpp"
#include "core/gps_time.hpp"
#include "core/units.hpp"

namespace imud {

inline constexpr std::int64_t constellation_week = 2400, constellation_s = 319'488;
inline constexpr std::int64_t constellation_ns = constellation_week * gps_week_ns + constellation_s * 1'000'000'000;
inline constexpr int constellation_size = 24, unhealthy = 13;

inline AlmanacOrbit orbit_of(int prn) {
  const int plane = (prn - 1) / 4, slot = (prn - 1) % 4;
  return {.prn = prn,
          .reference_ns = constellation_ns,
          .eccentricity = 0.001 * (1 + (prn * 7) % 19),
          .inclination = 0.95 + 0.002 * ((prn * 5) % 11),
          .node_rate = -8.0e-9 - 1e-11 * prn,
          .root_axis = 5153.5 + 0.05 * (prn % 7),
          .node = -3.0 + plane * units::pi / 3 + 0.01 * slot,
          .perigee = -3.1 + 0.26 * prn,
          .mean_anomaly = -2.9 + 1.571 * slot + 0.262 * plane + 0.01 * prn};
}

// Its healthy satellites.
inline std::vector<AlmanacOrbit> constellation() {
  std::vector<AlmanacOrbit> orbits;
  for (int prn = 1; prn <= constellation_size; ++prn)
    if (prn != unhealthy) orbits.push_back(orbit_of(prn));
  return orbits;
}

}  // namespace imud
