// Earth: what there is at a place on it for a magnetometer, a barometer and a GNSS receiver.
#pragma once

#include "core/sample.hpp"
#include "core/timeline.hpp"

namespace imud {

// How the truth's frame N stands to the Earth.
struct EarthModel {
  enum class Frame : std::uint8_t {
    none,      // unknown: no place, no magnetic field, no pressure
    local,     // N is fixed to the Earth: north-east-down at the origin below
    inertial,  // N's origin is the Earth's centre, its z the axis of rotation, to the north
  };
  Frame frame = Frame::none;
  // Where the vehicle rests before the first truth, and local: N's origin. rad, geodetic, and m above the WGS 84
  // ellipsoid.
  double latitude = 0, longitude = 0, height = 0;
  Vector3 rest_yaw_pitch_roll = Vector3::Zero();  // rad, of B relative to L, while the vehicle rests
  double angle = 0;               // inertial: rad, from N's x axis to the prime meridian at truth time 0
  std::int64_t start_gps_ns = 0;  // GPS time at truth time 0, since 1980-01-06
};

// Nanoseconds of GPS time since it began, of a UTC given as seconds since 1970-01-01; from 2017 on, when GPS time
// came to be 18 s ahead.
std::int64_t gps_ns_from_unix(std::int64_t utc_s) noexcept;
// The Earth rotation angle then, rad from 0 to 2 pi, UTC taken as UT1 (IERS Conventions 2010, Eq. 5.15).
double earth_rotation_angle(std::int64_t utc_s) noexcept;

// Pressure, Pa, at a geopotential altitude, m (U.S. Standard Atmosphere 1976, Eq. 33a and 33b, up to 84 852 m; above,
// its last temperature holds on, and below sea level the first layer).
double standard_pressure(double geopotential_m) noexcept;
double geopotential_altitude(double height_m) noexcept;  // Eq. 18, with r_0 = 6 356 766 m

// Normal gravity of the WGS 84 ellipsoid, m/s^2, gravitation and centrifugal acceleration together, at a geodetic
// latitude, rad, and a height above the ellipsoid, m (NGA.STND.0036, Eq. 4-1 and 4-3: to the second order in the
// height: within 1e-6 m/s^2 at the equator up to 10 km).
double normal_gravity(double latitude, double height) noexcept;

// North, east and down at a geodetic latitude and longitude, rad, as columns in E.
Matrix3 dcm_EL(double latitude, double longitude) noexcept;

class Earth {
 public:
  explicit Earth(const EarthModel& model);

  bool is_on() const noexcept { return model_.frame != EarthModel::Frame::none; }
  // Of a point whose position the truth knows; unknown below the surface by more than 100 km, where no sensor works.
  Navigation navigation(const PositionVelocity& position) const noexcept;
  // From N to north-east-down at `navigation`.
  Quaternion q_LN(TruthTime time, const Navigation& navigation) const noexcept;
  // T, in L: the dipole of IGRF-14 (first degree, 2025, with its secular variation) at the model's start.
  Vector3 magnetic_field_L(const Navigation& navigation) const noexcept;
  // Pa.
  double pressure(const Navigation& navigation) const noexcept {
    return standard_pressure(geopotential_altitude(navigation.height));
  }

 private:
  Quaternion q_NE(TruthTime time) const noexcept;

  EarthModel model_;
  Quaternion q_EN_local_;  // local only
  Vector3 origin_E_;
  Vector3 dipole_;  // T, in E: of the field at the equator of the reference sphere
};

}  // namespace imud
