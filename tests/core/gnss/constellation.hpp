// A made-up constellation of GPS for tests: 24 satellites in six planes.
#pragma once

#include <fmt/format.h>

#include <string>
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

// The lines of one satellite in the YUMA format.
inline std::string yuma_lines(const AlmanacOrbit& orbit, int health, int week) {
  return fmt::format(
      "******** Week {3} almanac for PRN-{0:02} ********\r\nID:                         {0:02}\r\n"
      "Health:                     {1:03}\r\nEccentricity:               {4:.12E}\r\n"
      "Time of Applicability(s):  {2}.0000\r\nOrbital Inclination(rad):   {5:.12f}\r\n"
      "Rate of Right Ascen(r/s):  {6:.12E}\r\nSQRT(A)  (m 1/2):           {7:.9f}\r\n"
      "Right Ascen at Week(rad):  {8:.14E}\r\nArgument of Perigee(rad):   {9:.14f}\r\n"
      "Mean Anom(rad):            {10:.14E}\r\nAf0(s):                     0.1335144043E-004\r\n"
      "Af1(s/s):                   0.0000000000E+000\r\nweek:                        {3}\r\n\r\n",
      orbit.prn, health, constellation_s, week, orbit.eccentricity, orbit.inclination, orbit.node_rate,
      orbit.root_axis, orbit.node, orbit.perigee, orbit.mean_anomaly);
}

inline std::string yuma_text(int week = constellation_week) {
  std::string text;
  for (int prn = 1; prn <= constellation_size; ++prn)
    text += yuma_lines(orbit_of(prn), prn == unhealthy ? 63 : 0, week);
  return text;
}

}  // namespace imud
