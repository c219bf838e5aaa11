// The constellation of the tests as a file in the YUMA format.
#pragma once

#include <fmt/format.h>

#include <string>

#include "tests/core/gnss/constellation.hpp"

namespace imud {

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
