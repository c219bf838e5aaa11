// RestDetector: finds by a unit's own gyros and accelerometers that it is at rest.
#pragma once

#include <optional>

#include "core/navigation/navigator_model.hpp"
#include "core/vector.hpp"

namespace imud {

// Over a window of a second, the rate and the specific force must be constant, the rate near 0 and the force of
// gravity's size: the tests of rate, variance and magnitude in Skog, Haendel, Nilsson, Rantakokko, Zero-velocity
// detection - an algorithm evaluation (IEEE Transactions on Biomedical Engineering 57(11), 2010). The limits are
// chosen: they are for a vehicle with its engine off, and widened by the noise of the sensors.
//
// Sensors alone cannot tell rest from a smooth flight at constant velocity; the speed must be known to be small as
// well. Nothing here allocates, locks or throws; not thread-safe.
class RestDetector {
 public:
  static constexpr double window_s = 1;
  static constexpr double largest_rate = 0.004;         // rad/s, of the mean rate: 0.23 deg/s
  static constexpr double largest_rate_change = 0.004;  // rad/s, standard deviation of each axis
  static constexpr double largest_force_change = 0.05;  // m/s^2, the same
  static constexpr double largest_force_error = 0.3;    // m/s^2, of the mean force's size from gravity's

  explicit RestDetector(const InertialNoise& noise) noexcept : noise_(noise) {}

  void begin() noexcept { *this = RestDetector(noise_); }
  // Adds a step of `dt` s, above 0, in platform axes, less the biases: rad and m/s. Returns at the end of a window
  // whether the platform was at rest in the window, and nullopt before the end. `gravity`: m/s^2, at the vehicle's
  // place.
  std::optional<bool> add(const Vector3& delta_angle, const Vector3& delta_velocity, double dt,
                          double gravity) noexcept;

 private:
  InertialNoise noise_;
  double time_s_ = 0;
  int steps_ = 0;
  Vector3 rates_ = Vector3::Zero(), rates2_ = Vector3::Zero();    // the sums of the rates, and of their squares
  Vector3 forces_ = Vector3::Zero(), forces2_ = Vector3::Zero();  // of the specific forces
};

}  // namespace imud
