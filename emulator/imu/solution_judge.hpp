// SolutionJudge: the errors of a unit's own navigation solution against the truth.
#pragma once

#include <optional>

#include "core/earth/earth.hpp"
#include "core/imu.hpp"
#include "core/timeline.hpp"
#include "emulator/faults/fault_log.hpp"

namespace imud {

// Compares a sample before and after its Navigator. Nothing here allocates after construction, locks or throws; one
// thread.
class SolutionJudge {
 public:
  explicit SolutionJudge(const ImuModel& model) : earth_(model.earth), r_SB_P_(model.dcm_PB * model.r_SB_B) {}

  // Keeps the truth of a sample, whose attitude is still the true one. `position_B`: of B's origin at the time of the
  // sample; `rate_P`: the true rate, rad/s, in platform axes.
  void keep(const Sample& sample, const PositionVelocity& position_B, const Vector3& rate_P) noexcept;
  // Returns the errors of the same sample's solution. Velocity and position have none where either is unknown.
  SolutionErrors errors(const Sample& sample) const noexcept;

 private:
  Earth earth_;
  Vector3 r_SB_P_;  // m
  Quaternion q_LP_ = Quaternion::Identity();
  Navigation navigation_;
};

}  // namespace imud
