// Gravitation: the attraction of the Earth, which accelerometers do not measure. Unlike gravity, it does not contain
// the centrifugal acceleration of axes that turn with the Earth.
#pragma once

#include <cstdint>

#include "core/vector.hpp"

namespace imud {

// A model of the gravitation in the truth's frame N.
struct GravitationModel {
  enum class Kind : std::uint8_t {
    none,
    constant,   // along N's z axis, which points down
    j2,         // the Earth's centre is N's origin, its axis N's z: central, and the zonal harmonic of degree 2
    wgs84,      // the whole normal gravity field of the ellipsoid WGS 84
    automatic,  // wgs84 at a position that is near the Earth; constant at any other, taken as in a local level
  };
  Kind kind = Kind::automatic;
  double constant = 9.80665;  // m/s^2

  // Returns whether the gravitation needs a position near the Earth.
  bool needs_position() const noexcept { return kind == Kind::j2 || kind == Kind::wgs84; }
};

// Returns whether the models of the Earth's field are valid at a position relative to the Earth's centre, m: whether
// the position is more than half of the Earth's radius from the centre.
bool is_near_earth(const Vector3& r_N) noexcept;

// Returns the gravitation at a position, m, in N, m/s^2; 0 if the model needs a position near the Earth and `r_N`
// is not near it (is_near_earth()). The same bits on every machine.
//
// wgs84: NGA.STND.0036, the closed formulas of section 4.2 in ellipsoidal coordinates, without the terms of the
// centrifugal acceleration. q and q' are the series of Heiskanen and Moritz, Physical Geodesy, section 2-7, as the
// closed expressions cancel. j2: Vallado, Fundamentals of Astrodynamics and Applications, section 8.6.1.
Vector3 gravitation_N(const GravitationModel& model, const Vector3& r_N) noexcept;

}  // namespace imud
