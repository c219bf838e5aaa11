// The time of the bus, as a slave of GlobalTimeSync: a message has the time at which its sender, the master, sent its
// previous one, which the slave has received.
#pragma once

#include <cstdint>

#include "core/time.hpp"

namespace imud::dronecan {

class BusTime {
 public:
  static constexpr Nanoseconds timeout = std::chrono::milliseconds(2200);
  static constexpr Nanoseconds longest_period = std::chrono::milliseconds(1100);

  // Processes a message. Of several masters, that with the lowest node id counts, and another one when it has been
  // silent for the timeout. `previous_us`: in the message, 56 bits; 0: its sender's first.
  void receive(unsigned master, unsigned transfer_id, std::uint64_t previous_us, DeviceTime now) noexcept;
  // Returns the time of the bus in us, modulo 2^56, at `time`; 0 if it is not known, or the master is silent.
  std::uint64_t at(DeviceTime time) const noexcept;
  void clear() noexcept { *this = {}; }
  void step_clock(Nanoseconds by) noexcept;

 private:
  unsigned master_ = 0;  // node id; 0: none
  unsigned transfer_id_ = 0;
  DeviceTime last_;        // when its last message was received
  bool is_known_ = false;  // the time of the bus was reference_us_ at reference_
  DeviceTime reference_;
  std::uint64_t reference_us_ = 0;
};

// Returns the duration in us, rounded to the nearest.
constexpr std::int64_t microseconds(Nanoseconds duration) noexcept {
  const std::int64_t rest = duration.count() % 1000;
  return duration.count() / 1000 + (rest >= 500) - (rest <= -500);
}

}  // namespace imud::dronecan
