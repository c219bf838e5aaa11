// The time of the bus, for a slave of GlobalTimeSync. A message of the master has the time at which the master sent
// its previous message. The slave has noted when it received that previous message.
#pragma once

#include <cstdint>

#include "core/time.hpp"

namespace imud::dronecan {

class BusTime {
 public:
  static constexpr Nanoseconds timeout = std::chrono::milliseconds(2200);
  static constexpr Nanoseconds longest_period = std::chrono::milliseconds(1100);

  // Processes a message. Among several masters, the master with the lowest node id is followed; after this master has
  // been silent for `timeout`, another one. `previous_us`: from the message, 56 bits; 0: the master's first message.
  void receive(unsigned master, unsigned transfer_id, std::uint64_t previous_us, DeviceTime now) noexcept;
  // Returns the time of the bus at `time`, us, modulo 2^56; 0 if this is not known, or the master is silent.
  std::uint64_t at(DeviceTime time) const noexcept;
  void clear() noexcept { *this = {}; }
  void step_clock(Nanoseconds by) noexcept;

 private:
  unsigned master_ = 0;  // node id; 0: none
  unsigned transfer_id_ = 0;
  DeviceTime last_;        // when the master's last message was received
  bool is_known_ = false;  // the time of the bus was reference_us_ at reference_
  DeviceTime reference_;
  std::uint64_t reference_us_ = 0;
};

// Returns the duration in us, rounded to nearest.
constexpr std::int64_t microseconds(Nanoseconds duration) noexcept {
  const std::int64_t rest = duration.count() % 1000;
  return duration.count() / 1000 + (rest >= 500) - (rest <= -500);
}

}  // namespace imud::dronecan
