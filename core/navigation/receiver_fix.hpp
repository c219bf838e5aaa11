// ReceiverFix: the last fix of a receiver that makes fixes at a rate of its own.
#pragma once

#include <algorithm>
#include <cstdint>

#include "core/sample.hpp"
#include "core/time.hpp"

namespace imud {

// A fix is made at every epoch of the receiver, a constant number of samples apart. Between two epochs the fix stays
// as it is, with the line of its antennas, and its age grows. So a loss of the fix, and its return, show at the next
// epoch. Nothing here allocates, locks or throws; not thread-safe.
class ReceiverFix {
 public:
  // `every`: the number of samples from one epoch to the next; 0: every sample is an epoch.
  explicit ReceiverFix(std::uint64_t every) noexcept
      : every_(static_cast<std::uint32_t>(std::clamp<std::uint64_t>(every, 1, UINT32_MAX))) {}

  // Makes the next sample an epoch.
  void restart() noexcept { since_epoch_ = 0; }
  // Returns whether the sample that report() writes next is an epoch.
  bool is_epoch() const noexcept { return since_epoch_ == 0; }
  // Writes the fix that the receiver reports with a sample. `possible`: the fix that the receiver would make at
  // this sample; the age of this fix is the latency of the receiver. `dt`: the time since the last sample, s.
  void report(const Navigation& possible, double dt, Solution& solution) noexcept {
    if (is_epoch()) {
      fix_ = possible;
    } else if (fix_.is_known) {  // the receiver's clock runs on; an error of it shows at the next epoch
      fix_.age += nanoseconds(dt);
      fix_.antennas.age += nanoseconds(dt);
      fix_.gps_ns += nanoseconds(dt).count();
    }
    solution.receiver = fix_;
    solution.has_epochs = true;
    solution.since_epoch = since_epoch_;
    if (++since_epoch_ == every_) since_epoch_ = 0;
  }

 private:
  std::uint32_t every_, since_epoch_ = 0;  // samples
  Navigation fix_;
};

}  // namespace imud
