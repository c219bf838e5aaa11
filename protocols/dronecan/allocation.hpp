// The allocation of a node id by another node, by the rules A to E of dynamic_node_id.Allocation. The unit sends its
// unique id in parts, in three anonymous requests.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <random>
#include <span>

#include "core/time.hpp"
#include "protocols/dronecan/messages.hpp"
#include "protocols/wire/deadlines.hpp"

namespace imud::dronecan {

using UniqueId = std::array<std::uint8_t, 16>;

// Returns the discriminator of the unit's anonymous messages, 14 bits: the same for all messages of the unit.
unsigned discriminator_of(const UniqueId& unique_id) noexcept;

class Allocation {
 public:
  explicit Allocation(const UniqueId& unique_id) noexcept;

  // Begins the allocation at `now`. Requests are due until there is a node id.
  void start(DeviceTime now) noexcept;
  void stop() noexcept { timers_.clear(); }
  // See Device::deadline(); nullopt if no node id is requested.
  std::optional<DeviceTime> deadline() const noexcept { return timers_.next(); }
  // Returns the request that is due. Requires `now` at deadline() or later.
  Payload poll(DeviceTime now) noexcept;
  void step_clock(Nanoseconds by) noexcept { timers_.step_clock(by); }

  // Reports that another node has requested a node id. This node then waits.
  void wait(DeviceTime now) noexcept;
  // Processes an allocator's message. Returns this unit's node id if the message assigns it.
  std::optional<unsigned> receive(std::span<const std::byte> message, DeviceTime now) noexcept;

 private:
  // Returns a random time from `shortest` to `longest`.
  Nanoseconds random(Nanoseconds shortest, Nanoseconds longest) noexcept;

  UniqueId unique_id_;
  std::minstd_rand random_;
  enum class Timer : std::uint8_t {
    follow_up,  // the next part is sent
    request,    // the first part is sent; not scheduled: no node id is requested
    count
  };
  Deadlines<Timer> timers_;
  std::size_t known_ = 0;  // bytes of the unique id that the allocator has
};

}  // namespace imud::dronecan
