#include "core/gnss/almanac.hpp"

#include <cmath>

#include "core/gps_time.hpp"
#include "core/numbers/elementary.hpp"

namespace imud {

Vector3 satellite_E(const AlmanacOrbit& orbit, std::int64_t gps_ns) noexcept {
  constexpr double gravitation = 3.986005e14, earth_rate = 7.2921151467e-5;  // m^3/s^2, rad/s: IS-GPS-200
  const double t = 1e-9 * static_cast<double>(gps_ns - orbit.reference_ns);
  const double reference_s = 1e-9 * static_cast<double>(orbit.reference_ns % gps_week_ns);
  const double axis = orbit.root_axis * orbit.root_axis, e = orbit.eccentricity;
  const double mean = orbit.mean_anomaly + (std::sqrt(gravitation / axis) / axis + orbit.motion) * t;
  double eccentric = mean;
  constexpr int steps = 12;  // the error falls by the eccentricity with each
  for (int i = 0; i < steps; ++i) eccentric = mean + e * elementary::sincos(eccentric).sin;
  const elementary::SinCos of_eccentric = elementary::sincos(eccentric);
  const double uncorrected =
      elementary::atan2(std::sqrt(1 - e * e) * of_eccentric.sin, of_eccentric.cos - e) + orbit.perigee;
  const elementary::SinCos twice = elementary::sincos(2 * uncorrected);
  const auto correction = [&twice](const AlmanacOrbit::Harmonic& harmonic) {
    return harmonic.cosine * twice.cos + harmonic.sine * twice.sin;
  };
  const double latitude = uncorrected + correction(orbit.of_latitude);
  const double radius = axis * (1 - e * of_eccentric.cos) + correction(orbit.of_radius);
  const double inclination = orbit.inclination + orbit.inclination_rate * t + correction(orbit.of_inclination);
  const double node = orbit.node + (orbit.node_rate - earth_rate) * t - earth_rate * reference_s;
  const elementary::SinCos u = elementary::sincos(latitude), i = elementary::sincos(inclination),
                           n = elementary::sincos(node);
  const double x = radius * u.cos, y = radius * u.sin;
  return {x * n.cos - y * i.cos * n.sin, x * n.sin + y * i.cos * n.cos, y * i.sin};
}

}  // namespace imud
