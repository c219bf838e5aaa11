// Truth: the simulator's motion of the vehicle at one instant.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "core/time.hpp"
#include "core/vector.hpp"

namespace imud {

// The way in which a simulator accumulates Truth::accumulated_dv_B.
enum class AccumulatedDv : std::uint8_t {
  none,      // not given
  inertial,  // a vector accumulated in inertial space, given in the body axes of the instant
  body_sum,  // sum of increments, each in the body axes at the end of its own truth step
};

// The state of the vehicle beside its motion, which acts on the surroundings of its sensors: the speed of a rotor or
// an engine, rad/s; the throttle, 0 to 1; the airspeed, m/s; the dynamic pressure, Pa; an electric current, A.
enum class VehicleState : std::uint8_t { rotor_speed, throttle, airspeed, dynamic_pressure, current };
inline constexpr std::size_t vehicle_state_count = 5;

class VehicleStates {
 public:
  bool is_empty() const noexcept { return given_ == 0; }
  std::optional<double> operator[](VehicleState state) const noexcept {
    return (given_ & bit(state)) != 0 ? std::optional(value_[static_cast<std::size_t>(state)]) : std::nullopt;
  }
  void set(VehicleState state, double value) noexcept {
    value_[static_cast<std::size_t>(state)] = value;
    given_ |= bit(state);
  }
  // Returns whether the magnitudes of all given states are at most `limit`; false if a given state is not a number.
  bool are_within(double limit) const noexcept;

 private:
  static constexpr unsigned bit(VehicleState state) noexcept { return 1U << static_cast<unsigned>(state); }
  unsigned given_ = 0;
  std::array<double, vehicle_state_count> value_ = {};
};

// The time of a clock that hosts share, or none.
struct ClockStamp {
  SharedClock clock = SharedClock::none;
  SharedTime time;  // not valid with SharedClock::none
};

// The motion of the vehicle body B relative to inertial space N (frames: core/README.md), in SI and radians. A
// member whose `has_` is false must not be read.
struct Truth {
  TruthTime time;
  std::uint32_t stream = 0;    // the vehicle's number
  std::uint32_t sequence = 0;  // the sender's number of this truth, modulo 2^32; 0 where the format has none
  bool acknowledge = false;    // the sender waits for an acknowledgement (lockstep)
  bool new_run = false;        // the sender marks the first truth of a new run
  ClockStamp stamp;            // the instant at which the simulation has the time `time`

  bool has_position = false;
  Vector3 r_BN_N = Vector3::Zero();  // m; position of B's origin
  bool has_velocity = false;
  Vector3 v_BN_N = Vector3::Zero();          // m/s; the velocity of B's origin
  Quaternion q_NB = Quaternion::Identity();  // unit; v_N = q_NB * v_B
  bool has_rate = true;
  Vector3 omega_BN_B = Vector3::Zero();  // rad/s; 0 if it is not given

  // True if N's origin is the Earth's centre, and N's z axis the Earth's axis of rotation, to the north.
  bool has_earth_angle = false;
  double earth_angle = 0;  // rad, from N's x axis to the prime meridian at truth time 0
  bool has_date = false;
  std::int64_t start_gps_ns = 0;  // the GPS time at truth time 0, ns since 1980-01-06

  bool has_angular_acceleration = false;
  Vector3 omegaDot_BN_B = Vector3::Zero();  // rad/s^2

  bool has_specific_force = false;
  Vector3 specific_force_B = Vector3::Zero();  // m/s^2; non-gravitational acceleration of B's origin

  AccumulatedDv accumulated_dv = AccumulatedDv::none;
  Vector3 accumulated_dv_B = Vector3::Zero();  // m/s; integral of the specific force, from an arbitrary origin

  bool has_temperature = false;
  double temperature_c = 0;  // degrees Celsius; of the sensor's surroundings
  bool has_magnetic_field = false;
  Vector3 magnetic_field_B = Vector3::Zero();  // T
  bool has_pressure = false;
  double pressure = 0;  // Pa; static
  VehicleStates vehicle;

  bool is_rate_derived = false;   // omega_BN_B and omegaDot_BN_B were derived from attitudes
  bool is_force_derived = false;  // the specific force was derived from positions or velocities
  bool follows_gap = false;       // derived: poses are missing between the truth before and this one
};

// Returns whether every number of `truth`, given or not, is finite.
bool is_finite(const Truth& truth) noexcept;
// The model's range: the largest magnitude of each component, and of the time. No vehicle moves beyond it.
namespace truth_limit {
inline constexpr double time_ns = 0x1p62;            // excluded
inline constexpr double position = 1e15;             // m
inline constexpr double velocity = 1e9;              // m/s; of the accumulated velocity, too
inline constexpr double rate = 1e5;                  // rad/s
inline constexpr double angular_acceleration = 1e8;  // rad/s^2
inline constexpr double specific_force = 1e8;        // m/s^2
inline constexpr double temperature = 1e4;           // degrees Celsius
inline constexpr double magnetic_field = 1e6;        // T
inline constexpr double pressure = 1e12;             // Pa
inline constexpr double vehicle = 1e9;               // of VehicleStates, in SI
}  // namespace truth_limit

// Returns whether every number of a finite `truth` is in the model's range, and the quaternion's length within 1e-6
// of 1.
bool is_in_range(const Truth& truth) noexcept;

}  // namespace imud
