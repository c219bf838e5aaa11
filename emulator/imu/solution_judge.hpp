// SolutionJudge: the errors of a unit's own navigation solution against the truth.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>

#include "core/earth/earth.hpp"
#include "core/imu.hpp"
#include "core/timeline.hpp"
#include "emulator/faults/fault_log.hpp"
#include "emulator/imu/sample_feed.hpp"

namespace imud {

// The difference of a solution from the truth.
struct SolutionDifference {
  Vector3 attitude;        // rad, the rotation vector from the true attitude to the solution's, axes of L
  bool has_place = false;  // the following are known: m/s and m, along north, east and down at the true place
  Vector3 velocity = Vector3::Zero(), position = Vector3::Zero();
};

// Compares a sample before and after its Navigator. Nothing here allocates after construction, locks or throws; one
// thread.
class SolutionJudge {
 public:
  explicit SolutionJudge(const ImuModel& model) : earth_(model.earth), r_SB_P_(model.dcm_PB * model.r_SB_B) {}

  // From now on the truth is also kept for the samples of the imu that `feed` wants, not only while faults act.
  // `feed` must outlive this.
  void watch(const SampleFeed& feed, std::size_t imu) noexcept {
    feed_ = &feed;
    imu_ = imu;
  }
  // Keeps the truth for the same watchers as `other` does.
  void watch_as(const SolutionJudge& other) noexcept {
    feed_ = other.feed_;
    imu_ = other.imu_;
  }
  bool is_watched(const Sample& sample) const noexcept {
    return feed_ != nullptr && feed_->wants(imu_, sample.counter);
  }
  // Keeps the truth of a sample. The attitude of `sample` must still be the true one. `position_B`: of B's origin at
  // the time of the sample; `rate_P`: the true rate, rad/s, in platform axes.
  void keep(const Sample& sample, const PositionVelocity& position_B, const Vector3& rate_P) noexcept;
  // Returns the errors of the same sample's solution. Velocity and position have none where either is unknown.
  SolutionErrors errors(const Sample& sample) const noexcept;
  // Returns the errors as vectors; nullopt if the truth of `sample` was not kept.
  std::optional<SolutionDifference> difference(const Sample& sample) const noexcept;

 private:
  Earth earth_;
  Vector3 r_SB_P_;  // m
  Quaternion q_LP_ = Quaternion::Identity();
  Navigation navigation_;
  std::optional<std::uint64_t> kept_;  // the number of the sample whose truth was kept last
  const SampleFeed* feed_ = nullptr;
  std::size_t imu_ = 0;
};

}  // namespace imud
