#include "core/navigation/coarse_alignment.hpp"

#include "core/attitude.hpp"

namespace imud {
namespace {

// Returns the axes of a right-handed frame as columns. The first is along `first`, the second across both vectors,
// the third across the first two.
Matrix3 frame_of(const Vector3& first, const Vector3& second) {
  Matrix3 m;
  m.col(0) = first.normalized();
  m.col(1) = first.cross(second).normalized();
  m.col(2) = m.col(0).cross(m.col(1));
  return m;
}

}  // namespace

Quaternion rotation_of_pairs(const Vector3& first_A, const Vector3& second_A, const Vector3& first_B,
                             const Vector3& second_B) noexcept {
  return Quaternion(Matrix3(frame_of(first_A, second_A) * frame_of(first_B, second_B).transpose())).normalized();
}

bool are_apart(const Vector3& a, const Vector3& b, double least_sine2) noexcept {
  return a.cross(b).squaredNorm() > least_sine2 * a.squaredNorm() * b.squaredNorm();
}

void CoarseAlignment::add(const Vector3& delta_angle, const Vector3& delta_velocity, double dt,
                          const Vector3& magnetic_field) noexcept {
  time_s_ += dt;
  delta_velocity_ += q_P0P_ * right_jacobian(-delta_angle, delta_velocity);
  q_P0P_ = (q_P0P_ * exp(delta_angle)).normalized();
  field_s_ += dt * (q_P0P_ * magnetic_field);
}

}  // namespace imud
