// PlaceWatch: compares the first truth of a run with [earth].
#pragma once

#include <span>

#include "core/truth.hpp"
#include "emulator/plan/config.hpp"

namespace imud {

// Where the two differ, the truth's own place and angle are used, and the configuration's date. Each function writes
// the difference, with both values, and returns the length of the text; 0: there is none. No allocation.
class PlaceWatch {
 public:
  explicit PlaceWatch(const TruthConfig& config)
      : earth_(config.earth), is_angle_given_(config.is_earth_angle_given) {}

  std::size_t describe_place(const Truth& truth, std::span<char> room) const noexcept;
  std::size_t describe_date(const Truth& truth, std::span<char> room) const noexcept;

 private:
  EarthModel earth_;
  bool is_angle_given_;
};

}  // namespace imud
