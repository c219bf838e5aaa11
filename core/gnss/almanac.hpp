// The orbits of an almanac, and where their satellites are.
#pragma once

#include <cstdint>

#include "core/vector.hpp"

namespace imud {

// The orbit of one satellite by an almanac of GPS.
struct AlmanacOrbit {
  int prn = 0;                           // 1 to 63
  std::int64_t reference_ns = 0;         // GPS time of applicability, ns since 1980-01-06
  double eccentricity = 0;               // 0 to 0.1
  double inclination = 0;                // rad
  double node_rate = 0;                  // rad/s, of the right ascension of the ascending node
  double root_axis = 0;                  // m^(1/2), the root of the semi-major axis, above 2000
  double node = 0;                       // rad, that right ascension at the begin of the week, less the Earth's angle
  double perigee = 0, mean_anomaly = 0;  // rad, the argument of the perigee; at the time of applicability
};

// Returns the satellite's position in E, m, at a GPS time, by the equations of an ellipse whose node moves
// (IS-GPS-200, Table 20-IV, without the harmonic terms, which an almanac lacks, section 20.3.3.5.2.1; compared with
// alm2pos() of RTKLIB 71db0ff, src/ephemeris.c). Pure; the same bits on every machine.
Vector3 satellite_E(const AlmanacOrbit& orbit, std::int64_t gps_ns) noexcept;

}  // namespace imud
