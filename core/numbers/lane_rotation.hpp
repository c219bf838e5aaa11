// Rotations in vector registers: the functions of core/attitude.hpp and of Eigen that every sample needs, with the
// same bits, for about half of the instructions. A quaternion has the lanes x, y, z, w. Functions without a comment
// have the arguments and results of log(), exp(), right_jacobian() and inverse_right_jacobian() there.
#pragma once

#include "core/numbers/elementary.hpp"
#include "core/numbers/lanes.hpp"
#include "core/vector.hpp"

namespace imud {

[[gnu::always_inline]] inline Lanes lanes(const Quaternion& q) noexcept { return Lanes{q.x(), q.y(), q.z(), q.w()}; }
[[gnu::always_inline]] inline Quaternion quaternion_of(Lanes q) noexcept { return {q[3], q[0], q[1], q[2]}; }

// Returns a x b.
[[gnu::always_inline]] inline Lanes cross(Lanes a, Lanes b) noexcept {
  const Lanes a_yzx = __builtin_shufflevector(a, a, 1, 2, 0, 3), b_yzx = __builtin_shufflevector(b, b, 1, 2, 0, 3);
  const Lanes zxy = a * b_yzx - a_yzx * b;
  return __builtin_shufflevector(zxy, zxy, 1, 2, 0, 3);
}

// Returns |a|^2, added up in the order of Eigen.
[[gnu::always_inline]] inline double squared_norm(Lanes a) noexcept {
  const Lanes squares = a * a;
  return squares[0] + (squares[1] + squares[2]);
}

[[gnu::always_inline]] inline Lanes conjugate(Lanes q) noexcept {
  return change_sign(LaneMask{INT64_MIN, INT64_MIN, INT64_MIN, 0}, q);
}

// Returns the product of two quaternions.
[[gnu::always_inline]] inline Lanes product(Lanes a, Lanes b) noexcept {
  constexpr LaneMask w_minus = {0, 0, 0, INT64_MIN};
  const Lanes second = __builtin_shufflevector(a, a, 0, 1, 2, 0) * __builtin_shufflevector(b, b, 3, 3, 3, 0);
  const Lanes third = __builtin_shufflevector(a, a, 1, 2, 0, 1) * __builtin_shufflevector(b, b, 2, 0, 1, 1);
  const Lanes fourth = __builtin_shufflevector(a, a, 2, 0, 1, 2) * __builtin_shufflevector(b, b, 1, 2, 0, 2);
  return all_lanes(a[3]) * b + change_sign(w_minus, second) + change_sign(w_minus, third) - fourth;
}

// Returns q * v, v_N = q_NB * v_B.
[[gnu::always_inline]] inline Lanes rotate(Lanes q, Lanes v) noexcept {
  Lanes uv = cross(q, v);
  uv += uv;
  return v + all_lanes(q[3]) * uv + cross(q, uv);
}

[[gnu::always_inline]] inline Lanes log_of_rotation(Lanes q) noexcept {
  const double w = q[3];
  Lanes sigma = q / all_lanes(w >= 0.0 ? 1.0 + w : w - 1.0);
  double square = squared_norm(sigma);
  if (square > 1.0) [[unlikely]] {
    sigma = -sigma / all_lanes(square);
    square = squared_norm(sigma);
  }
  return all_lanes(4.0 * elementary::atan_over_x(square)) * sigma;
}

[[gnu::always_inline]] inline Lanes exp_of_rotation(Lanes phi) noexcept {
  const auto half = elementary::even_series(0.25 * squared_norm(phi));
  const Lanes v = all_lanes(0.5 * half.sinc) * phi;
  return __builtin_shufflevector(v, all_lanes(half.cos), 0, 1, 2, 7);
}

[[gnu::always_inline]] inline Lanes right_jacobian(Lanes phi, Lanes v) noexcept {
  const auto even = elementary::even_series(squared_norm(phi));
  const Lanes first = cross(phi, v);
  return v - all_lanes(even.versine) * first + all_lanes(even.cubic) * cross(phi, first);
}

[[gnu::always_inline]] inline Lanes inverse_right_jacobian(Lanes phi, Lanes omega) noexcept {
  const auto half = elementary::even_series(0.25 * squared_norm(phi));
  const double c = (half.versine - half.cubic) / (4.0 * half.sinc);
  const Lanes first = cross(phi, omega);
  return omega + all_lanes(0.5) * first + all_lanes(c) * cross(phi, first);
}

}  // namespace imud
