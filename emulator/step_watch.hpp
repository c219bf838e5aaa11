// StepWatch: finds gaps in a truth stream by its time steps.
#pragma once

#include "core/time.hpp"

namespace imud {

// Learns the usual step from the steps themselves, which may change: after a gap, a step may be twice as long before
// it is a gap. The first step of a run is usual.
class StepWatch {
 public:
  static constexpr int far_above = 3;  // a step of more than so many usual ones is a gap

  void begin_run() noexcept { usual_ = Nanoseconds{0}; }
  // Returns true if `step`, above 0, from one truth to the next is a gap.
  bool is_gap(Nanoseconds step) noexcept {
    if (usual_.count() == 0) {
      usual_ = step;
      return false;
    }
    const bool gap = step > far_above * usual_;
    usual_ += gap ? usual_ : (step - usual_) / 8;
    return gap;
  }

 private:
  Nanoseconds usual_{0};  // 0: none yet
};

}  // namespace imud
