// CoarseAlignment: a first attitude from the specific force, the magnetic field, and the velocity of a receiver.
#pragma once

#include "core/vector.hpp"

namespace imud {

// Returns the rotation q_AB of two pairs of directions, v_A = q_AB * v_B: it turns `first_B` into the direction of
// `first_A`, and the part of `second_B` across it into the same part of `second_A` (TRIAD: Black, AIAA Journal 2(7),
// 1964). No pair may be parallel.
Quaternion rotation_of_pairs(const Vector3& first_A, const Vector3& second_A, const Vector3& first_B,
                             const Vector3& second_B) noexcept;

// Returns whether the square of the sine of the angle between two vectors is above `least_sine2`, which is not
// negative. Returns false if a vector is 0.
bool are_apart(const Vector3& a, const Vector3& b, double least_sine2) noexcept;

// Sums up the increments of a window in the platform's axes at its begin, P0. In any motion, the sum of the delta-
// velocities is the change of the velocity less the gravitation's, resolved in P0. Nothing here allocates, locks or
// throws; the same bits on every machine.
class CoarseAlignment {
 public:
  void begin() noexcept { *this = CoarseAlignment(); }
  // Adds a step of `dt` s: the rotation vector from the platform before it to the platform after, rad; the
  // delta-velocity, m/s; the magnetic field after it, T, 0 where it is unknown.
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
