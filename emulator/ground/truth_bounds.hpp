// TruthBounds: finds numbers and steps of truth beyond every vehicle that the sensors are built for. It refuses
// nothing: a remark names the first of each kind.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <optional>

#include "core/truth.hpp"

namespace imud {

// 0: no bound.
struct TruthBounds {
  double rate = 0;          // rad/s, of the whole vector
  double acceleration = 0;  // m/s^2, of the specific force, and of the velocity less the gravitation
  double velocity = 0;      // m/s
};

// Compares each truth with the bounds and with the truth before it. Allocates nothing. One thread.
class BoundsWatch {
 public:
  enum class Kind : std::uint8_t {
    rate,      // the rate is greater than its bound, rad/s
    force,     // the specific force is greater than its bound, m/s^2
    velocity,  // the velocity is greater than its bound, m/s
    turn,      // the attitude turns faster than the bound of the rate, rad/s
    speed_up,  // the velocity changes faster than the bound of the acceleration and the gravitation, m/s^2
    jump,      // the position is elsewhere than the velocities lead, m
  };
  static constexpr std::size_t kinds = 6;
  // A number of the truth that is beyond its bound.
  struct Excess {
    Kind kind = Kind::rate;
    double value = 0, bound = 0;
  };

  explicit BoundsWatch(const TruthBounds& bounds) noexcept : bounds_(bounds) {}

  // Returns the first excess in `truth` whose kind was not returned before; nullopt: there is none. `follows`:
  // `truth` is later than the truth before it, and of the same run.
  std::optional<Excess> check(const Truth& truth, bool follows) noexcept {
    std::optional<Excess> found;
    const auto compare = [&](Kind kind, double value, double bound) {
      if (value <= bound || found || is_told_[static_cast<std::size_t>(kind)]) return;
      is_told_[static_cast<std::size_t>(kind)] = true;
      found = Excess{kind, value, bound};
    };
    if (bounds_.rate > 0 && truth.has_rate) compare(Kind::rate, truth.omega_BN_B.norm(), bounds_.rate);
    if (bounds_.acceleration > 0 && truth.has_specific_force)
      compare(Kind::force, truth.specific_force_B.norm(), bounds_.acceleration);
    if (bounds_.velocity > 0 && truth.has_velocity) compare(Kind::velocity, truth.v_BN_N.norm(), bounds_.velocity);
    const double dt = seconds(truth.time - last_.time);
    constexpr double longest = 1.0;  // s; later steps are gaps
    if (follows && dt > 0 && dt <= longest) {
      if (bounds_.rate > 0) {
        const double sine = std::min(1.0, (last_.q_NB.conjugate() * truth.q_NB).vec().norm());
        const double turn = 2.0 * std::asin(sine);
        if (turn > angle_resolution) compare(Kind::turn, (turn - angle_resolution) / dt, bounds_.rate);
      }
      if (bounds_.acceleration > 0 && truth.has_velocity && last_.has_velocity) {
        const double change = (truth.v_BN_N - last_.v_BN_N).norm();
        const double bound = bounds_.acceleration + gravitation;
        if (change > velocity_resolution) compare(Kind::speed_up, (change - velocity_resolution) / dt, bound);
        if (truth.has_position && last_.has_position) {
          const Vector3 travelled = (0.5 * dt) * (truth.v_BN_N + last_.v_BN_N);
          const double off = (truth.r_BN_N - last_.r_BN_N - travelled).norm();
          compare(Kind::jump, off, position_resolution + 0.25 * bound * dt * dt);
        }
      }
    }
    last_ = {truth.time, truth.has_position, truth.has_velocity, truth.r_BN_N, truth.v_BN_N, truth.q_NB};
    return found;
  }

 private:
  // The coarsest numbers of a simulator: angles with three decimals, velocities in cm/s, places in float32 degrees.
  static constexpr double angle_resolution = 2e-3, velocity_resolution = 0.05, position_resolution = 4.0;
  static constexpr double gravitation = 9.84;  // m/s^2, the greatest on the ground

  struct Last {
    TruthTime time;
    bool has_position = false, has_velocity = false;
    Vector3 r_BN_N = Vector3::Zero(), v_BN_N = Vector3::Zero();
    Quaternion q_NB = Quaternion::Identity();
  };

  TruthBounds bounds_;
  Last last_;
  std::array<bool, kinds> is_told_ = {};
};

}  // namespace imud
