// The models and the truth whose steps are counted and timed: one sample with one truth.
#pragma once

#include <cstdint>
#include <vector>

#include "core/imu.hpp"
#include "tools/truth/motion.hpp"

namespace imud {

enum class Coupling : std::uint8_t { diagonal, full };

// The memo's errors, all of them on, and none at its limit.
inline TriadErrors every_error(double sigma, Coupling coupling) {
  TriadErrors errors;
  errors.scale_factor = {1.001, 0.999, 1.002};
  errors.bias = {0.01, -0.02, 0.005};
  errors.walk_transition = 0.99 * Matrix3::Identity();
  errors.walk_sqrt_cov = sigma * Matrix3::Identity();
  if (coupling == Coupling::full) {
    errors.walk_transition(0, 1) = errors.walk_transition(2, 0) = 0.001;
    errors.walk_sqrt_cov(1, 0) = errors.walk_sqrt_cov(2, 1) = 0.1 * sigma;
  }
  errors.walk_bound = Vector3::Constant(20.0 * sigma);
  errors.lsb = 0.1 * sigma;
  errors.carry = true;
  errors.max = 1e4 * sigma;
  return errors;
}

inline ImuModel memo_model(Coupling coupling, DeltaVelocity delta_velocity, DeltaAngle delta_angle) {
  ImuModel model;
  model.r_SB_B = {0.3, -0.2, 0.5};
  model.dcm_PB << 0.36, 0.48, -0.8, -0.8, 0.6, 0.0, 0.48, 0.64, 0.6;
  model.gyro = every_error(1e-3, coupling);
  model.accelerometer = every_error(1e-2, coupling);
  model.delta_angle = delta_angle;
  model.delta_velocity = delta_velocity;
  return model;
}

// A tactical sensor as its data sheet describes it, at 2 kHz: misalignment, turn-on bias, white noise, bias
// instability in eight octaves, random walk, a low-pass filter, and counted increments.
inline TriadErrors tactical_errors(double white_density, double bias_instability, double random_walk, double max) {
  TriadErrors errors;
  errors.misalignment << 1, 2e-4, -1e-4, 1e-4, 1, 3e-4, -2e-4, 1e-4, 1;
  errors.scale_factor = Vector3::Constant(1.0002);
  errors.turn_on_bias = Vector3::Constant(10 * bias_instability);
  errors.white_density = Vector3::Constant(white_density);
  errors.bias_instability = Vector3::Constant(bias_instability);
  errors.flicker_from_s = 1;
  errors.flicker_to_s = 40;
  errors.random_walk_density = Vector3::Constant(random_walk);
  errors.filter.cut_off_hz = Vector3::Constant(262);
  errors.lsb = 1e-3 * white_density;
  errors.increment_lsb = 1e-6 * white_density;
  errors.max = max;
  return errors;
}

inline ImuModel tactical_model() {
  ImuModel model;
  model.rate_hz = 2000;
  model.r_SB_B = {0.3, -0.2, 0.5};
  model.gyro = tactical_errors(4.4e-5, 2.4e-6, 1e-8, 7);
  model.accelerometer = tactical_errors(1e-3, 4.9e-4, 1e-6, 98);
  return model;
}

// An endless truth stream: 200 truths of a coning motion (10 turns at 5 ms), repeated with later times.
class Truths {
 public:
  explicit Truths(Nanoseconds step) : length_(step * 200) {
    const Motion& coning = *find_motion("coning");
    for (std::int64_t k = 0; k < 200; ++k) cycle_.push_back(coning.at(TruthTime{} + k * step, MotionParameters{}));
  }
  const Truth& next() {
    Truth& truth = cycle_[i_];
    if (laps_ > 0) truth.time = truth.time + length_;
    if (++i_ == cycle_.size()) {
      i_ = 0;
      ++laps_;
    }
    return truth;
  }

 private:
  std::vector<Truth> cycle_;
  Nanoseconds length_;
  std::size_t i_ = 0;
  std::int64_t laps_ = 0;
};

}  // namespace imud
