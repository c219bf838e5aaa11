// SizeEffect: the errors that arise because the accelerometers of a sensor are not at one point.
#pragma once

#include "core/numbers/lanes.hpp"
#include "core/timeline.hpp"
#include "core/vector.hpp"

namespace imud {

enum class DeltaVelocity : std::uint8_t;

// Accelerometer i is at S + rho_i; row i of the positions is rho_i, in platform axes. It measures component i of the
// specific force there, which differs from the one at S by (P. G. Savage, "Strapdown Sensors and Strapdown System
// Analysis", NATO RTO-EN-SET-116, size effect)
//   omega' x rho_i + omega x (omega x rho_i)
// The delta-velocity, too, is that at the accelerometer's own point, in its configured definition. Does not allocate,
// lock or throw; not thread-safe.
class SizeEffect {
 public:
  SizeEffect(const Matrix3& positions, const Matrix3& dcm_PB)
      : positions_(positions),
        lane_positions_(positions),
        dcm_PB_(dcm_PB),
        lane_dcm_PB_(dcm_PB),
        on_(!positions.isZero(0.0)) {}
  bool is_on() const noexcept { return on_; }

  // Extends the sum of omega x (omega x rho_i) by its integral between two states of a smooth motion.
  void add_piece(const MotionState& begin, const MotionState& end, double h) noexcept;
  // Adds the differences of the specific forces at `now` to the values, m/s^2, in platform axes.
  void add_to_values(const MotionState& now, Vector3& values) const noexcept;
  // Returns the difference of the increments over the step from `last` to `now`, for which the sum was extended, m/s.
  Vector3 increments(const MotionBegin& last, const MotionState& now, DeltaVelocity definition) const noexcept;
  // Begins the sum of the next step.
  void clear() noexcept { centripetal_sum_ = {}; }

 private:
  Vector3 in_P(const Vector3& v_B) const noexcept { return vector_of(lane_dcm_PB_ * v_B); }
  Lanes cross(const Vector3& a) const noexcept;
  Lanes centripetal(const Vector3& omega) const noexcept;
  Lanes centripetal_slope(const Vector3& omega, const Vector3& omega_dot) const noexcept;

  Matrix3 positions_;
  LaneMatrix lane_positions_;
  Matrix3 dcm_PB_;
  LaneMatrix lane_dcm_PB_;
  bool on_;
  LaneVector centripetal_sum_;  // m/s
};

}  // namespace imud
