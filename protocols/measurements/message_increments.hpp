// The increments since a message was last sent.
#pragma once

#include "core/attitude.hpp"
#include "protocols/measurements/measured_quantities.hpp"

namespace imud {

struct MessageIncrements {
  DeviceTime sent = {};  // when they begin
  Vector3 delta_angle = Vector3::Zero(), delta_velocity = Vector3::Zero();
  Quaternion rotation = Quaternion::Identity();

  void begin(DeviceTime now) noexcept {
    sent = now;
    delta_angle.setZero();
    delta_velocity.setZero();
    rotation.setIdentity();
  }
  void add(const Sample& sample) noexcept {
    constexpr double largest_turn = 1e4;  // rad; sine and cosine of larger angles are not defined
    delta_angle += sample.delta_angle;
    delta_velocity += sample.delta_velocity;
    const Vector3 turn = sample.delta_angle.cwiseMax(-largest_turn).cwiseMin(largest_turn);
    rotation = (rotation * exp(turn)).normalized();
  }
  Reading reading(const Sample& sample, const OwnFigures& figures) const noexcept {
    return {sample, delta_angle, delta_velocity, rotation, seconds(sample.time - sent), &figures};
  }
};

}  // namespace imud
