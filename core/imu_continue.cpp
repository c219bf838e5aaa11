// A sensor with other parameters takes the place of one that has sampled.
#include <algorithm>
#include <cmath>

#include "core/imu.hpp"

namespace imud {

void Imu::continue_from(const Imu& before) noexcept {
  normals_ = before.normals_;
  unit_normals_ = before.unit_normals_;
  power_on_normals_ = before.power_on_normals_;
  power_ons_ = before.power_ons_;
  draw_constants();
  counter_ = before.counter_;
  // The time since power on goes on, rounded to a period.
  const double since_power_on = before.time_since_power_on();
  powered_on_ =
      counter_ - static_cast<std::uint64_t>(static_cast<std::int64_t>(std::floor(since_power_on / period_s_ + 0.5)));
  if (period_s_ == before.period_s_) powered_on_ = before.powered_on_;
  internal_ = before.internal_;
  internal_.taken = std::min(internal_.taken, model_.internal_samples - 1);
  if (!before.has_internal()) internal_.time = before.last_time_;
  const bool is_first = counter_ == before.powered_on_;
  if (!before.has_internal()) internal_.since_power_on = is_first ? 0 : since_power_on - before.period_s_;
  gyro_.continue_from(before.gyro_, normals_, internal_number());
  accelerometer_.continue_from(before.accelerometer_, normals_, internal_number());
  magnetometer_.continue_from(before.magnetometer_, normals_, counter_);
  if (inclinometer_ && before.inclinometer_)
    inclinometer_->continue_from(*before.inclinometer_, normals_, internal_number());
  else if (inclinometer_)
    inclinometer_->seek(normals_, internal_number());
  barometer_.continue_from(before.barometer_, normals_, counter_);
  navigation_.continue_from(before.navigation_, normals_, counter_);
  temperature_.continue_from(before.temperature_);
  vibration_.continue_from(before.vibration_);
  surroundings_ = {temperature_.sensor_c(), before.surroundings_.temperature_rate, vibration_.power_factor()};

  run_ = before.run_;
  last_ = before.last_;
  last_time_ = before.last_time_;
  sampled_ = before.sampled_;
  last_force_B_ = before.last_force_B_;
  held_ = before.held_;
  may_catch_up_ = before.may_catch_up_;
  advanced_ = before.advanced_;
  revision_ = before.revision_;
  had_field_ = before.had_field_;
  origin_ = before.origin_;
  surroundings_c_ = before.surroundings_c_;
  true_rate_ = before.true_rate_;
  true_specific_force_ = before.true_specific_force_;
  angle_sum_B_ = before.angle_sum_B_;
  velocity_sum_B_ = before.velocity_sum_B_;
  centripetal_sum_B_ = before.centripetal_sum_B_;
  if (vibration_.is_on()) {  // the phases at the last sample
    Vector3 rate, delta_angle, specific_force, delta_velocity;
    rate = delta_angle = specific_force = delta_velocity = Vector3::Zero();
    vibration_.add_to({rate, delta_angle, specific_force, delta_velocity}, internal_.time, 0);
  }
}

}  // namespace imud
