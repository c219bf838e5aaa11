// Motion: analytic motions with derivatives and integrals in closed form, to test the whole chain.
#pragma once

#include <span>
#include <string_view>

#include "core/truth.hpp"

namespace imud {

// The parameters of all motions; each motion uses the parameters in its summary. SI, angles in rad.
struct MotionParameters {
  double rate_rad_per_s = 0.5;         // turntable, spiral, boost
  double half_angle_rad = 0.02;        // coning
  double frequency_hz = 10.0;          // coning
  double acceleration_m_per_s2 = 2.0;  // spiral, boost
  double jerk_m_per_s3 = 0.5;          // boost
  double gravity_m_per_s2 = 9.80665;   // all: along +z of N (down)
};

// A motion. `at` returns the truth at `time` (0 is the start of the motion), with angular acceleration, specific
// force and accumulated velocity (convention inertial, 0 at time 0), all exact to rounding.
struct Motion {
  std::string_view name;
  std::string_view summary;  // one line, with the parameters used
  Truth (*at)(TruthTime time, const MotionParameters& parameters);
};

// The motions: rest, turntable, coning, spiral, boost.
std::span<const Motion> motions() noexcept;
// Returns nullptr if no motion has that name.
const Motion* find_motion(std::string_view name) noexcept;

}  // namespace imud
