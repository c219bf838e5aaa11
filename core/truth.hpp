// Truth: what the simulator says of the vehicle at one instant.
#pragma once

#include <cstdint>

#include "core/time.hpp"
#include "core/vector.hpp"

namespace imud {

// How a truth's accumulated velocity was summed up (see Truth::accumulated_dv_B).
enum class AccumulatedDv : std::uint8_t {
  none,      // not given
  inertial,  // a vector accumulated in inertial space, given in the body axes of the instant
  body_sum,  // sum of increments, each in the body axes at the end of its own truth step
};

// Motion of the vehicle body B relative to inertial space N (frames: core/README.md). SI and radians.
struct Truth {
  TruthTime time;
  std::uint32_t stream = 0;    // which vehicle
  std::uint32_t sequence = 0;  // of the sender; 0 where the format has none
  bool acknowledge = false;    // the sender waits for an answer (lockstep)
  bool new_run = false;        // the sender says that this is the first truth of a new run

  bool has_position = false;                 // and velocity
  Vector3 r_BN_N = Vector3::Zero();          // m; position of B's origin
  Vector3 v_BN_N = Vector3::Zero();          // m/s
  Quaternion q_NB = Quaternion::Identity();  // unit; v_N = q_NB * v_B
  Vector3 omega_BN_B = Vector3::Zero();      // rad/s

  bool has_angular_acceleration = false;
  Vector3 omegaDot_BN_B = Vector3::Zero();  // rad/s^2

  bool has_specific_force = false;
  Vector3 specific_force_B = Vector3::Zero();  // m/s^2; non-gravitational acceleration of B's origin

  AccumulatedDv accumulated_dv = AccumulatedDv::none;
  Vector3 accumulated_dv_B = Vector3::Zero();  // m/s; integral of the specific force since the sender's start
};

// True if every number of `truth` is finite and within what the model accepts: position to 1e15 m, velocity and
// accumulated velocity to 1e9 m/s, rate to 1e5 rad/s, angular acceleration and specific force to 1e8 (SI), time
// within 2^62 ns of 0, quaternion of unit length within 1e-6.
bool is_finite(const Truth& truth) noexcept;
bool is_in_range(const Truth& truth) noexcept;

}  // namespace imud
