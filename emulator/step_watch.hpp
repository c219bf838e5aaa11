// StepWatch: finds gaps in a truth stream by its time steps.
#pragma once

#include <algorithm>

#include "core/time.hpp"

namespace imud {

// Learns the usual step from the steps themselves, which may change: after a gap, a step may be twice as long before
// it is a gap. The first two steps of a run are usual.
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

}  // namespace imud
