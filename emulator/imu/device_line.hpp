// DeviceLine: a port with the UART of the device behind it.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <span>

#include "core/uart.hpp"
#include "transports/port.hpp"

namespace imud {

class WirePort;

// The sampling thread alone uses it. Nothing here allocates or throws, and only wait() waits.
struct DeviceLine {
  std::unique_ptr<Port> port;
  UartSettings uart;                              // the device's settings that the port has
  std::uint64_t passed = 0;                       // frames passed to the port
  std::uint64_t had_room_at = ~std::uint64_t{0};  // `passed` when the port last had room
  bool listens = true;                            // the port may receive
  bool is_file = false;                           // a regular file, which accepts everything and never answers
  bool is_stalled = false;                        // the port has accepted nothing for 2 s
  // The number of the record's interface for frames that left. The next two numbers are for the host's bytes and for
  // dropped frames.
  std::uint16_t interface = 0;
  WirePort* wire = nullptr;  // the port, if faults act on it
  PortCounters before = {};  // the sums over the ports that were replaced

  // Sets `listens` and `is_file`. Called when `port` was set.
  void look_at_port() noexcept {
    listens = port->can_receive();
    is_file = !listens && port->descriptor() < 0;
  }
  // Adds the counters of the port to `before`. Called when another port takes its place.
  void add_to_before() noexcept;

  // Passes frames of the device's time `time` to the port, by Port::reply() or by Port::send().
  void send(std::span<const Frame> frames, DeviceTime time, bool is_reply) noexcept {
    port->set_time(time);
    if (is_reply)
      port->reply(frames);
    else
      port->send(frames);
    passed += frames.size();
  }
  // Returns true while the port has neither sent nor dropped all frames that were passed to it.
  bool holds_back() const noexcept;
  // Returns true if it is not known that the port has room for the frames of a sample.
  bool may_lack_room() const noexcept { return !is_file && had_room_at != passed; }
  // Sets `had_room_at` if the port accepts more now, so that wait() need not be called before the next frames.
  void look_for_room() noexcept;
  // Waits until the port has sent all frames, and, if `for_room`, accepts more. If its reader or bus accepts nothing
  // for 2 s, the port is no longer waited for until it has accepted all frames. Also returns when `stop` is set.
  void wait(bool for_room, const std::atomic<bool>& stop) noexcept;
};

}  // namespace imud
