// Earth: place, gravity, magnetic field and pressure, for magnetometers, barometers, GNSS receivers and vehicles at
// rest.
//
// All functions are pure and thread-safe, and give the same bits on every machine. They do not allocate or throw,
// except Earth's constructor, which may do both. Latitudes and longitudes are geodetic, on WGS 84 (NGA.STND.0036), in
// rad.
#pragma once

#include <optional>

#include "core/earth/magnetic_field.hpp"
#include "core/sample.hpp"
#include "core/timeline.hpp"
#include "core/truth.hpp"
#include "core/units.hpp"

namespace imud {

// Returns the difference of two angles, rad, in [-pi, pi].
double angle_between(double angle, double other) noexcept;

// The relation of the truth's frame N to the Earth.
struct EarthModel {
  enum class Frame : std::uint8_t {
    none,       // unknown: there is no place, no magnetic field, no pressure
    automatic,  // inertial where the truth has an earth_angle, elsewhere none
    local,      // N is fixed to the Earth: north-east-down at the origin below
    inertial,   // N's origin is the Earth's centre, its z the axis of rotation, to the north
  };
  Frame frame = Frame::none;
  // The place of a vehicle at rest before the first truth; where the frame is local, N's origin as well. rad, and m
  // above the ellipsoid.
  double latitude = 0, longitude = 0, height = 0;
  bool is_rest_known = false;  // automatic only: the vehicle at rest is at that place; false: its place is unknown
  Vector3 rest_yaw_pitch_roll = Vector3::Zero();  // rad, of B relative to L, at rest
  // rad, from N's x axis to the prime meridian at truth time 0; inertial only. The truth's own angle is used instead
  // where the two differ by more than largest_angle_error.
  double angle = 0;
  static constexpr double largest_angle_error = 1e-5;  // rad, 64 m at the equator
  std::int64_t start_gps_ns = 0;                       // GPS time at truth time 0, ns since 1980-01-06
};

// Returns the Earth's angle at the time of a truth that has it, rad, from N's x axis to the prime meridian.
inline double earth_angle_at(const Truth& truth) noexcept {
  return truth.earth_angle + units::earth_rate * seconds(truth.time - TruthTime{});
}

// Returns a GPS time, ns since 1980-01-06, as a decimal year: the calendar year and the fraction of it that has
// passed.
double decimal_year(std::int64_t gps_ns) noexcept;
// Returns the Earth rotation angle at this UTC, taken as UT1, rad in [0, 2 pi) (IERS Conventions 2010, Eq. 5.15).
double earth_rotation_angle(std::int64_t utc_s) noexcept;

// Returns the pressure, Pa, at a geopotential altitude, m (U.S. Standard Atmosphere 1976, Eq. 33a and 33b). Above
// 84.852 km, where the standard ends, the temperature stays constant; below sea level the lowest layer continues.
double standard_pressure(double geopotential_m) noexcept;
// Returns the geopotential altitude, m, that has this pressure, Pa, above 0: the inverse of
// standard_pressure().
double standard_altitude(double pressure) noexcept;
// Returns the geopotential altitude, m, of a height in m, which must be greater than -6 356 766, the negative radius
// of the Earth (U.S. Standard Atmosphere 1976, Eq. 18).
double geopotential_altitude(double height_m) noexcept;
// Returns the height, m, of a geopotential altitude, m, below 6 356 766: the inverse of geopotential_altitude().
double height_of(double geopotential_m) noexcept;

// Returns normal gravity, gravitation and centrifugal acceleration together, m/s^2, at a latitude and a height above
// the ellipsoid, m (NGA.STND.0036, Eq. 4-1 and 4-3, to the second order in the height; within 1e-6 m/s^2 at the
// equator up to 10 km).
double normal_gravity(double latitude, double height) noexcept;

// The first returns the position in E, m, of a place, the second the place of a position. The position must be at
// least 6000 km from the Earth's centre.
Vector3 r_E_of(const Geodetic& place) noexcept;
Geodetic geodetic_of(const Vector3& r_E) noexcept;

// Returns the matrix v_E = dcm_EL * v_L at a latitude and longitude: its columns are north, east and down.
Matrix3 dcm_EL(double latitude, double longitude) noexcept;

// Returns the position, m, of a known place relative to its origin, in the axes of L at the origin: the coordinates
// north, east and down of the plane that touches the Earth there.
Vector3 r_L_from_origin(const Navigation& navigation) noexcept;

// Moves a known place by `offset_L`, m, in the axes of L at the place before the move. The components of v_L do
// not change.
void move(Navigation& navigation, const Vector3& offset_L) noexcept;

// The Earth in relation to the truth's frame N. Immutable.
class Earth {
 public:
  explicit Earth(const EarthModel& model);

  // Returns false where the frame is none: then navigation() never knows a place.
  bool is_on() const noexcept { return model_.frame != EarthModel::Frame::none; }
  // Returns whether navigation() knows a place only by PositionVelocity::earth_angle.
  bool is_automatic() const noexcept { return model_.frame == EarthModel::Frame::automatic; }
  // Returns the place of a point. The place is unknown if `position` is unknown, or if the point is more than some
  // 100 km below the surface. A position with an earth_angle is taken to be in an inertial N, whatever the model's
  // frame.
  Navigation navigation(const PositionVelocity& position) const noexcept;
  // Returns position and velocity in N of a known place, of which r_E and v_L are used; the inverse of navigation().
  // `earth_angle` as in PositionVelocity.
  PositionVelocity position_velocity(const Navigation& navigation, TruthTime time,
                                     std::optional<double> earth_angle) const noexcept;
  // Returns the origin of relative positions in a run whose first position is `first`: N's own where the frame is
  // local, elsewhere the place of `first`; nullopt if the place is unknown.
  std::optional<Geodetic> origin(const PositionVelocity& first) const noexcept;
  // Returns the rotation v_L = q_LN * v_N at the known place of `position`.
  Quaternion q_LN(const PositionVelocity& position, const Navigation& navigation) const noexcept;
  // Returns the magnetic field at a known place, T, in L, by IGRF-14 at the model's start (igrf.hpp). IGRF has the
  // field of the core only. The crust and the ionosphere add some 0.1 uT.
  Vector3 magnetic_field_L(const Navigation& navigation) const noexcept;
  // Returns the pressure at a known place, Pa.
  double pressure(const Navigation& navigation) const noexcept {
    return standard_pressure(geopotential_altitude(navigation.height));
  }

 private:
  bool is_local(const PositionVelocity& position) const noexcept;
  Quaternion q_NE(const PositionVelocity& position) const noexcept;

  EarthModel model_;
  Quaternion q_EN_local_;  // where the frame is local
  Vector3 origin_E_;       // m, local frame
  MagneticField magnetic_field_;
};

}  // namespace imud
