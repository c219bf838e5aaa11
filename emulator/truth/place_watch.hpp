// PlaceWatch: compares the first truth of a run with [earth].
#pragma once

#include <span>

#include "core/truth.hpp"
#include "emulator/plan/config.hpp"

namespace imud {

// Where the two differ, a run uses the truth's own place and angle, and the configuration's date. Each describe
// function writes a text into `room`, such as the difference with both values, and returns its length; 0: there is no
// text. No allocation.
class PlaceWatch {
 public:
  explicit PlaceWatch(const TruthConfig& config)
      : earth_(config.earth),
        is_angle_given_(config.is_earth_angle_given),
        awaits_place_(config.is_place_needed && config.earth.frame != EarthModel::Frame::none) {}

  // Counts the accepted truths of a run in which an imu needs a place. Returns true once: at the tenth truth, if none
  // of the ten has a place.
  bool lacks_place(const Truth& truth) noexcept {
    if (!awaits_place_) [[likely]]
      return false;
    constexpr int enough = 10;  // a format of several messages may have the place in a later one
    const bool has_place = has_pose(truth) && is_on_earth(truth);
    awaits_place_ = !has_place && ++without_place_ < enough;
    return !has_place && !awaits_place_;
  }
  // Writes which quantities are missing. `format` names them.
  std::size_t describe_no_place(const Truth& truth, const TruthFormat& format, std::span<char> room) const noexcept;

  std::size_t describe_place(const Truth& truth, std::span<char> room) const noexcept;
  std::size_t describe_date(const Truth& truth, std::span<char> room) const noexcept;

 private:
  static bool has_pose(const Truth& truth) noexcept { return truth.has_position && truth.has_velocity; }
  bool is_on_earth(const Truth& truth) const noexcept {
    return earth_.frame != EarthModel::Frame::automatic || truth.has_earth_angle;
  }

  EarthModel earth_;
  bool is_angle_given_;
  bool awaits_place_;  // an imu needs a place, and no truth has had one
  int without_place_ = 0;
};

}  // namespace imud
