// SpeedMismatch: whether the two ends of a line have had different speeds for so long that it is no negotiation.
#pragma once

#include <optional>

#include "core/time.hpp"
#include "transports/port.hpp"

namespace imud {

// A host that negotiates a bit rate differs from the line for a moment, or tries several bit rates. Neither is worth
// a report. One thread.
class SpeedMismatch {
 public:
  // Called while the two ends have different speeds; `now` rises from call to call. Returns true if this pair of
  // speeds has lasted for `least`, or if the ends have differed, by any speeds, for five times as long.
  bool lasts(Port::Speeds speeds, HostTime now, Nanoseconds least) noexcept {
    if (!begin_) begin_ = now;
    if (now == *begin_ || speeds.line != speeds_.line || speeds.client != speeds_.client) {
      speeds_ = speeds;
      since_ = now;
    }
    return now - since_ >= least || now - *begin_ >= 5 * least;
  }
  // The speeds match, or nobody is there.
  void end() noexcept { begin_.reset(); }

 private:
  std::optional<HostTime> begin_;  // of the mismatch
  HostTime since_;                 // when both ends came to their present speeds
  Port::Speeds speeds_;
};

}  // namespace imud
