// Rest: the vehicle that stands still before the simulator's first truth.
#pragma once

#include "core/earth/earth.hpp"
#include "core/timeline.hpp"

namespace imud {

// The motion of a vehicle at rest, in closed form. Everything that its sensors measure is constant:
//
//   frame            place                  rate                          specific force
//   none             unknown                0                             standard gravity, up
//   others           the model's, constant  the Earth's, units::earth_rate  normal_gravity() at the place, up
//
// An automatic frame is none unless the place is known (EarthModel::is_rest_known). "Up" is opposite to L's z; where
// the frame is none, N is L. The vehicle's attitude relative to L is the model's `rest_yaw_pitch_roll`. Normal
// gravity is taken as vertical at every height (in fact it leans by 0.8e-6 rad at 1 km and 45 deg).
//
// Times count from power-on, which stands for truth time 0. Nothing here allocates, locks or throws; immutable.
class Rest {
 public:
  explicit Rest(const EarthModel& model);

  // Returns the state at `time`, relative to the inertial frame N that coincides with L at the instant `aligned`;
  // dv_N is integrated from that instant. Choose `aligned` near `time`: then the numbers are small, and increments
  // are as exact after years as in the first second.
  MotionState at(TruthTime time, TruthTime aligned) const noexcept;

  // Returns the Earth with a `local` frame whose origin is the vehicle's place; it is off where the model's frame is
  // none.
  const Earth& earth() const noexcept { return earth_; }

 private:
  Earth earth_;
  Quaternion q_LB_;
  Vector3 omega_BN_B_;        // rad/s
  Vector3 specific_force_B_;  // m/s^2
};

}  // namespace imud
