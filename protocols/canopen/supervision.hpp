// Supervision (CiA 301, 7.2.8): the node's heartbeat (1017), the heartbeats that it awaits (1016), node guarding
// (100C, 100D), and the period of SYNC (1006).
#pragma once

#include "protocols/canopen/object_dictionary.hpp"

namespace imud::canopen {

class Supervision {
 public:
  Supervision(const ObjectDictionary& dictionary, Alarms& alarms) noexcept
      : dictionary_(dictionary), alarms_(alarms) {}

  // Boot-up at `now`: supervision begins. Heartbeats begin one period later.
  void start(DeviceTime now) noexcept;
  // Takes changed parameters into account: a new heartbeat time is effective at once.
  void update(std::size_t position, DeviceTime now) noexcept;
  // Returns the reason why 1016 cannot have that value, or Abort::none.
  Abort check_consumer(unsigned sub, std::uint64_t value) const noexcept;

  // Alarm::heartbeat at the time `due`: sends a heartbeat with `state`, and schedules the next one after `now`.
  void send_heartbeat(unsigned node_id, State state, DeviceTime due, DeviceTime now, FrameBuffer& out) noexcept;
  // Answers a remote request of node guarding, unless heartbeats are sent.
  void answer_guarding(unsigned node_id, State state, DeviceTime now, FrameBuffer& out) noexcept;

  // Another node has sent a heartbeat. Returns true if it had been lost.
  bool receive_heartbeat(unsigned node_id, DeviceTime now) noexcept;
  // Alarm::consumer_1 + `consumer`: returns the node whose heartbeat is lost.
  unsigned lose(unsigned consumer) noexcept;
  bool is_any_lost() const noexcept;

  // A SYNC has come: the next one is awaited within 1.5 periods.
  void receive_sync(DeviceTime now) noexcept;

 private:
  std::uint32_t consumer(unsigned i) const noexcept;

  const ObjectDictionary& dictionary_;
  Alarms& alarms_;
  std::array<bool, consumers> is_lost_ = {};
  bool toggle_ = false;
};

}  // namespace imud::canopen
