// CoarseAlignment: a first attitude from the specific force, the magnetic field, and the velocity of a receiver.
#pragma once

#include "core/vector.hpp"

namespace imud {

// Returns the rotation q_AB, v_A = q_AB * v_B, from two directions that are known in both frames (TRIAD: Black, AIAA
// Journal 2(7), 1964). q_AB turns `first_B` exactly into the direction of `first_A`; the second direction determines
// only the rotation about the first. In each frame the first and the second vector must not be 0 or parallel. Their
// lengths have no effect.
Quaternion rotation_of_pairs(const Vector3& first_A, const Vector3& second_A, const Vector3& first_B,
                             const Vector3& second_B) noexcept;

// Returns whether the square of the sine of the angle between two vectors is above `least_sine2`, which is not
// negative. Returns false if a vector is 0.
bool are_apart(const Vector3& a, const Vector3& b, double least_sine2) noexcept;

// Sums up the increments of a window of time, resolved in P0: the platform's axes at the begin of the window. In any
// motion the sum of the delta-velocities is the change of the velocity less the change by gravitation. Nothing here
// allocates, locks or throws; the same bits on every machine.
class CoarseAlignment {
 public:
  void begin() noexcept { *this = CoarseAlignment(); }
  // Adds a step of `dt` s. `delta_angle`: rad, the rotation vector from the platform before the step to the platform
  // after the step; `delta_velocity`: m/s; `magnetic_field`: T, after the step; 0 where unknown.
  void add(const Vector3& delta_angle, const Vector3& delta_velocity, double dt,
           const Vector3& magnetic_field) noexcept;

  double time_s() const noexcept { return time_s_; }
  const Vector3& delta_velocity_P0() const noexcept { return delta_velocity_; }  // m/s, its sum
  const Vector3& magnetic_field_P0() const noexcept { return field_s_; }         // T s, the integral of the field
  const Quaternion& q_P0P() const noexcept { return q_P0P_; }                    // v_P0 = q_P0P * v_P

 private:
  double time_s_ = 0;
  Quaternion q_P0P_ = Quaternion::Identity();
  Vector3 delta_velocity_ = Vector3::Zero(), field_s_ = Vector3::Zero();
};

}  // namespace imud
