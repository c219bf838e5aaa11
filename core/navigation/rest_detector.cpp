#include "core/navigation/rest_detector.hpp"

#include <cmath>

namespace imud {

std::optional<bool> RestDetector::add(const Vector3& delta_angle, const Vector3& delta_velocity, double dt,
                                      double gravity) noexcept {
  const Vector3 rate = delta_angle / dt, force = delta_velocity / dt;
  rates_ += rate;
  rates2_ += rate.cwiseProduct(rate);
  forces_ += force;
  forces2_ += force.cwiseProduct(force);
  time_s_ += dt;
  ++steps_;
  constexpr double rounding_s = 1e-6;
  constexpr int fewest = 5;
  if (time_s_ < window_s - rounding_s || steps_ < fewest) return std::nullopt;
  const double count = steps_;
  const Vector3 mean_rate = rates_ / count, mean_force = forces_ / count;
  const double rate2 = (rates2_ / count - mean_rate.cwiseProduct(mean_rate)).maxCoeff();
  const double force2 = (forces2_ / count - mean_force.cwiseProduct(mean_force)).maxCoeff();
  const double step_s = time_s_ / count;
  begin();
  // Returns the limit of a variance: `limit` squared, and twice the variance of a step's mean by white noise.
  const auto limit2 = [step_s](double limit, double density) {
    return limit * limit + 2 * density * density / step_s;
  };
  return rate2 <= limit2(largest_rate_change, noise_.gyro) &&
         force2 <= limit2(largest_force_change, noise_.accelerometer) && mean_rate.norm() <= largest_rate &&
         std::abs(mean_force.norm() - gravity) <= largest_force_error;
}

}  // namespace imud
