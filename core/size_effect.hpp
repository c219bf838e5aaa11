// SizeEffect: the accelerometers of a sensor are not at one point.
#pragma once

#include "core/timeline.hpp"
#include "core/vector.hpp"

namespace imud {

enum class DeltaVelocity : std::uint8_t;

// Accelerometer i is at S + rho_i; row i of the positions is rho_i, in platform axes. It measures component i of the
// specific force there, which differs from the one at S by (P. G. Savage, "Strapdown Sensors and Strapdown System
// Analysis", NATO RTO-EN-SET-116, size effect)
//   omega' x rho_i + omega x (omega x rho_i)
// The delta-velocity differs by the same lever arm in its definition. Does not allocate, lock
// or throw; not thread-safe.
class SizeEffect {
 public:
  SizeEffect(const Matrix3& positions, const Matrix3& dcm_PB)
      : positions_(positions), dcm_PB_(dcm_PB), on_(!positions.isZero(0.0)) {}
  bool is_on() const noexcept { return on_; }

  // Extends the sum of omega x (omega x rho_i) by its integral between two states of a smooth motion.
  [[gnu::noinline]] void add_piece(const MotionState& begin, const MotionState& end, double h) noexcept;
  // Adds the difference at `now` to the values, m/s^2.
  [[gnu::noinline]] void add_to_values(const MotionState& now, Vector3& values) const noexcept;
  // Returns the difference of the increments over the step from `last` to `now`, for which the sum was extended, m/s.
  [[gnu::noinline]] Vector3 increments(const MotionBegin& last, const MotionState& now,
                                       DeltaVelocity definition) const noexcept;
  // Begins the sum of the next step.
  void clear() noexcept { centripetal_sum_.setZero(); }

 private:
  Vector3 cross(const Vector3& a) const noexcept;
  Vector3 centripetal(const Vector3& omega) const noexcept;
  Vector3 centripetal_slope(const Vector3& omega, const Vector3& omega_dot) const noexcept;

  Matrix3 positions_, dcm_PB_;
  bool on_;
  Vector3 centripetal_sum_ = Vector3::Zero();  // m/s
};

}  // namespace imud
