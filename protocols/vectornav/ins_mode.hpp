// InsMode: the mode of VectorNav's INS, bits 0 and 1 of InsStatus, by the state of the unit's own filter.
// Sources: the manual of the VersaSync, page 352, whose INS is a VN-300; VN-200 user manual UM004, page 45.
#pragma once

#include <cmath>

#include "core/sample.hpp"
#include "core/units.hpp"

namespace imud::vectornav {

enum class InsMode : unsigned {
  not_tracking,  // without a fix; the heading is by the magnetometer
  aligning,      // with a fix; also while the uncertainty of the attitude is above 2 deg
  tracking,
  lost,  // no fix for 45 s: position and velocity keep their last values, and the attitude remains valid
};

// Returns the root of the mean square of the components.
inline double rms(const Vector3& v) noexcept { return v.norm() / std::sqrt(3.0); }

// Returns the mode of a unit whose filter has this solution. `has_fix`: whether the receiver has a fix.
inline InsMode ins_mode(const Solution& solution, bool has_fix) noexcept {
  constexpr float longest_outage_s = 45;
  constexpr double widest = 2 * units::degree;  // of AttUncertainty
  const bool navigates = solution.state == Solution::State::aided || solution.state == Solution::State::coasting;
  if (!navigates) return has_fix ? InsMode::aligning : InsMode::not_tracking;
  if (solution.since_fix_s > longest_outage_s) return InsMode::lost;
  return rms(solution.attitude.cast<double>()) > widest ? InsMode::aligning : InsMode::tracking;
}

// Keeps the last place and velocity, which the INS reports while the mode is `lost`.
class InsPlace {
 public:
  // In the mode `lost`, replaces place and velocity of the sample by the last ones; the time stays. In other modes,
  // keeps them.
  void hold(Sample& sample) noexcept {
    if (!sample.solution || !sample.navigation.is_known) {
      last_ = {};
    } else if (last_.is_known && ins_mode(*sample.solution, sample.fix().is_known) == InsMode::lost) {
      const std::int64_t gps_ns = sample.navigation.gps_ns;
      sample.navigation = last_;
      sample.navigation.gps_ns = gps_ns;
    } else {
      last_ = sample.navigation;
    }
  }
  void restart() noexcept { last_ = {}; }

 private:
  Navigation last_;
};

}  // namespace imud::vectornav
