// The correction of a Kalman filter by one component of a measurement.
#pragma once

#include <Eigen/Core>

#include "core/vector.hpp"

namespace imud {

// Corrects the covariance P by a measurement of the vector that begins at state `first`, along `axis`, and adds the
// corrections of the states to `change`. `innovation`: measured less estimated before any of `change`. In Joseph's
// form, which stays symmetric: (I - k h) P (I - k h)^T + k r k^T = P - k (P h)^T - (P h) k^T + s k k^T, where
// s = h P h^T + r.
template <int States>
void update_component(Eigen::Matrix<double, States, States>& P, int first, const Vector3& axis, double innovation,
                      double variance, Eigen::Matrix<double, States, 1>& change) noexcept {
  using State = Eigen::Matrix<double, States, 1>;
  State Ph;
  for (int i = 0; i < States; ++i)
    Ph[i] = P(i, first) * axis[0] + P(i, first + 1) * axis[1] + P(i, first + 2) * axis[2];
  const auto along = [&](const State& x) {
    return axis[0] * x[first] + axis[1] * x[first + 1] + axis[2] * x[first + 2];
  };
  const double s = along(Ph) + variance;
  const State k = Ph / s;
  for (int i = 0; i < States; ++i)
    for (int j = 0; j <= i; ++j) P(i, j) = P(j, i) = P(i, j) - k[i] * Ph[j] - Ph[i] * k[j] + s * (k[i] * k[j]);
  change += k * (innovation - along(change));
}

}  // namespace imud
