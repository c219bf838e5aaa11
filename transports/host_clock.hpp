// The host's clock as the ports read it, and the pauses between attempts to reopen a lost device.
#pragma once

#include <algorithm>
#include <chrono>
#include <ctime>

#include "core/time.hpp"

namespace imud {

// Returns the time of CLOCK_MONOTONIC.
inline HostTime host_now() noexcept {
  timespec now{};
  ::clock_gettime(CLOCK_MONOTONIC, &now);
  return {std::int64_t{now.tv_sec} * 1'000'000'000 + now.tv_nsec};
}

// Schedules the attempts to reopen a device: 100 ms after the loss, then twice as long after each attempt, up to 2
// s.
class BackOff {
 public:
  // Records that the device is lost now: the first attempt is due in 100 ms.
  void start() noexcept {
    pause_ = shortest;
    next_ = host_now() + pause_;
  }
  // Returns true if an attempt is due, once per pause; the next pause is twice as long.
  bool due() noexcept {
    const HostTime now = host_now();
    if (now < next_) return false;
    pause_ = std::min(pause_ * 2, longest);
    next_ = now + pause_;
    return true;
  }

 private:
  static constexpr Nanoseconds shortest = std::chrono::milliseconds(100);
  static constexpr Nanoseconds longest = std::chrono::seconds(2);
  Nanoseconds pause_ = shortest;
  HostTime next_;
};

}  // namespace imud
