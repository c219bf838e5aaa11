// The orbits of an almanac or of ephemerides, and where their satellites are.
#pragma once

#include <cstdint>

#include "core/vector.hpp"

namespace imud {

// The orbit of one satellite of GPS, by an almanac or an ephemeris.
struct AlmanacOrbit {
  int prn = 0;                           // 1 to 63
  bool is_healthy = true;                // else the satellite is not used while this orbit holds
  std::int64_t reference_ns = 0;         // GPS time of applicability or of the ephemeris, ns since 1980-01-06
  double eccentricity = 0;               // 0 to 0.1
  double inclination = 0;                // rad
  double node_rate = 0;                  // rad/s, of the right ascension of the ascending node
  double root_axis = 0;                  // m^(1/2), the root of the semi-major axis, above 2000
  double node = 0;                       // rad, that right ascension at the begin of the week, less the Earth's angle
  double perigee = 0, mean_anomaly = 0;  // rad, the argument of the perigee; at reference_ns
  // Only an ephemeris has these: the correction of the mean motion and the rate of the inclination, rad/s; and the
  // amplitudes of corrections by the cosine and the sine of twice the argument of the latitude.
  double motion = 0, inclination_rate = 0;
  struct Harmonic {
    double cosine = 0, sine = 0;
  };
  Harmonic of_latitude = {}, of_radius = {}, of_inclination = {};  // rad, m, rad
};

// Returns the satellite's position in E, m, at a GPS time, by the equations of an ellipse whose node moves
// (IS-GPS-200, Table 20-IV; an almanac lacks the harmonic terms, section 20.3.3.5.2.1; compared with alm2pos() and
// eph2pos() of RTKLIB 71db0ff, src/ephemeris.c). Pure; the same bits on every machine.
Vector3 satellite_E(const AlmanacOrbit& orbit, std::int64_t gps_ns) noexcept;

}  // namespace imud
