// StepWatch and TimeUnitWatch: find gaps, and times in a wrong unit, by the time steps of a truth stream.
#pragma once

#include <algorithm>

#include "core/time.hpp"

namespace imud {

// The usual step is learnt from the steps, and may change: each gap doubles the usual step. The first two steps of a
// run count as usual.
class StepWatch {
 public:
  static constexpr int far_above = 3;  // a step of more than so many usual ones is a gap

  void begin_run() noexcept {
    usual_ = Nanoseconds{0};
    count_ = 0;
  }
  // Returns true if `step`, above 0, from one truth to the next is a gap.
  bool is_gap(Nanoseconds step) noexcept {
    if (count_ < 2) {  // the first one may be short
      ++count_;
      usual_ = std::max(usual_, step);
      return false;
    }
    const bool gap = step > far_above * usual_;
    usual_ += gap ? usual_ : (step - usual_) / 8;
    return gap;
  }

 private:
  Nanoseconds usual_{0};
  int count_ = 0;  // of the steps so far, up to 2
};

// Finds times that are not in nanoseconds: no simulator sends a truth every 25 us. Looks at the first steps only.
// Seconds that are rounded to nanoseconds are 0 for half a second, then 1.
class TimeUnitWatch {
 public:
  static constexpr Nanoseconds shortest = std::chrono::microseconds(25);

  // `step`: from the newest truth; 0 for a repetition of its time. Returns true once: if the first three steps above
  // 0 are all shorter than `shortest`, or if the first one is shorter and follows many repetitions.
  bool is_wrong(Nanoseconds step) noexcept {
    constexpr int few = 3, many = 10;
    if (count_ >= few) return false;
    if (step.count() <= 0) {
      ++repeated_;
      return false;
    }
    step_ = step;
    count_ = step >= shortest ? few + 1 : repeated_ >= many ? few : count_ + 1;
    return count_ == few;
  }
  Nanoseconds step() const noexcept { return step_; }
  // The unit in which the steps would be usual ones.
  const char* probable_unit() const noexcept {
    if (step_.count() >= 100) return "microseconds";
    return repeated_ > 0 ? "seconds" : "milliseconds or seconds";
  }

 private:
  int count_ = 0;  // of steps above 0
  int repeated_ = 0;
  Nanoseconds step_{0};
};

}  // namespace imud
