// Rest: a vehicle that stands still, as its sensors have it before the simulator's first truth.
#pragma once

#include "core/earth.hpp"
#include "core/timeline.hpp"

namespace imud {

// The motion of a vehicle at rest, in closed form. Everything that its sensors measure is constant:
//
//   frame            place                  rate                          specific force
//   none             unknown                0                             standard gravity, up
//   local, inertial  the model's, constant  the Earth's, units::earth_rate  normal_gravity() at the place, up
//
// "Up" is opposite to L's z; where the frame is none, N is L. The vehicle's attitude relative to L is the model's
// `rest_yaw_pitch_roll`. Normal gravity is taken as vertical at every height (in fact it leans by 0.8e-6 rad at
// 1 km and 45 deg).
//
// Times count from power-on, which stands for truth time 0. Nothing here allocates, locks or throws; immutable.
class Rest {
 public:
  explicit Rest(const EarthModel& model);

  // The vehicle at `time`, relative to the inertial frame N that coincides with L at the instant `aligned`; its
  // velocity dv_N counts from there. The numbers are as small as the time between the two, so that increments are
  // as exact after years as in the first second.
  MotionState at(TruthTime time, TruthTime aligned) const noexcept;

  // The Earth whose frame is `local`, with its origin at the vehicle's; off where the model's frame is none.
  const Earth& earth() const noexcept { return earth_; }

 private:
  Earth earth_;
  Quaternion q_LB_;
  Vector3 omega_BN_B_;        // rad/s
  Vector3 specific_force_B_;  // m/s^2
};

}  // namespace imud
