// Supervision (CiA 301, 7.2.8): the node's own heartbeat (1017), the heartbeats of other nodes (1016), node guarding
// (100C, 100D), and the period of SYNC (1006).
#pragma once

#include "protocols/canopen/object_dictionary.hpp"

namespace imud::canopen {

class Supervision {
 public:
  Supervision(const ObjectDictionary& dictionary, Alarms& alarms) noexcept
      : dictionary_(dictionary), alarms_(alarms) {}

  // Begins supervision. Call this at boot-up. The first heartbeat is due one period later.
  void start(DeviceTime now) noexcept;
  // Applies the changed parameter at `position`. A new heartbeat time takes effect at once.
  void update(std::size_t position, DeviceTime now) noexcept;
  // Returns the reason why 1016 cannot be set to this value, or Abort::none.
  Abort check_consumer(unsigned sub, std::uint64_t value) const noexcept;

  // Sends a heartbeat with `state`, and schedules the next heartbeat after `now`. Call this at Alarm::heartbeat.
  // `due`: the time of the alarm.
  void send_heartbeat(unsigned node_id, State state, DeviceTime due, DeviceTime now, FrameBuffer& out) noexcept;
  // Answers a remote request of node guarding, unless the node sends heartbeats.
  void answer_guarding(unsigned node_id, State state, DeviceTime now, FrameBuffer& out) noexcept;

  // Processes the heartbeat of another node. Returns true if this heartbeat had been lost.
  bool receive_heartbeat(unsigned node_id, DeviceTime now) noexcept;
  // Notes that a heartbeat is lost, and returns its node. Call this at Alarm::consumer_1 + `consumer`.
  unsigned lose(unsigned consumer) noexcept;
  bool is_any_lost() const noexcept;

  // Notes a SYNC. The next SYNC is awaited within 1.5 periods.
  void receive_sync(DeviceTime now) noexcept;

 private:
  std::uint32_t consumer(unsigned i) const noexcept;

  const ObjectDictionary& dictionary_;
  Alarms& alarms_;
  std::array<bool, consumers> is_lost_ = {};
  bool toggle_ = false;
};

}  // namespace imud::canopen
