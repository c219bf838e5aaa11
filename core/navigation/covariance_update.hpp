// The correction of a Kalman filter by one component of a measurement.
#pragma once

#include <Eigen/Core>

#include "core/vector.hpp"

namespace imud {

// Returns P h^T, where h has `axis` at the three states from `first` on, and 0 elsewhere.
template <int States>
Eigen::Matrix<double, States, 1> times_axis(const Eigen::Matrix<double, States, States>& P, int first,
                                            const Vector3& axis) noexcept {
  Eigen::Matrix<double, States, 1> Ph;
  for (int i = 0; i < States; ++i)
    Ph[i] = P(i, first) * axis[0] + P(i, first + 1) * axis[1] + P(i, first + 2) * axis[2];
  return Ph;
}

// Returns h x.
template <int States>
double along_axis(const Eigen::Matrix<double, States, 1>& x, int first, const Vector3& axis) noexcept {
  return axis[0] * x[first] + axis[1] * x[first + 1] + axis[2] * x[first + 2];
}

// Corrects P by a measurement whose innovation has the variance s, and returns the gain k = P h^T / s. In Joseph's
// form, which stays symmetric: (I - k h) P (I - k h)^T + k r k^T = P - k (P h)^T - (P h) k^T + s k k^T, where
// s = h P h^T + r.
template <int States>
Eigen::Matrix<double, States, 1> correct(Eigen::Matrix<double, States, States>& P,
                                         const Eigen::Matrix<double, States, 1>& Ph, double s) noexcept {
  const Eigen::Matrix<double, States, 1> k = Ph / s;
  for (int i = 0; i < States; ++i)
    for (int j = 0; j <= i; ++j) P(i, j) = P(j, i) = P(i, j) - k[i] * Ph[j] - Ph[i] * k[j] + s * (k[i] * k[j]);
  return k;
}

// Corrects the covariance P by a measurement of the vector that begins at state `first`, along `axis`, and adds the
// corrections of the states to `change`. `innovation`: measured less estimated before any of `change`.
template <int States>
void update_component(Eigen::Matrix<double, States, States>& P, int first, const Vector3& axis, double innovation,
                      double variance, Eigen::Matrix<double, States, 1>& change) noexcept {
  const Eigen::Matrix<double, States, 1> Ph = times_axis(P, first, axis);
  const auto k = correct(P, Ph, along_axis(Ph, first, axis) + variance);
  change += k * (innovation - along_axis(change, first, axis));
}

// Changes P to the covariance after the vector that begins at state `first` has been rotated by R about `axis`, a
// unit vector, and after its component along `axis` has been set. This component has then the variance `variance`,
// and no correlation.
template <int States>
void turn_and_forget(Eigen::Matrix<double, States, States>& P, int first, const Matrix3& R, const Vector3& axis,
                     double variance) noexcept {
  const Matrix3 kept = R - axis * axis.transpose();
  const Eigen::Matrix<double, 3, States> rows = kept.lazyProduct(P.template middleRows<3>(first));
  const Matrix3 block = rows.template middleCols<3>(first).lazyProduct(kept.transpose());
  P.template middleRows<3>(first) = rows;
  P.template middleCols<3>(first) = rows.transpose();
  P.template block<3, 3>(first, first) = 0.5 * (block + block.transpose()) + variance * (axis * axis.transpose());
}

}  // namespace imud
