// LeavingPorts: ports that a reload has replaced, until they are closed.
#pragma once

#include <string>
#include <vector>

#include "emulator/imu/reload.hpp"
#include "transports/host_clock.hpp"

namespace imud {

// Closes a port when the frames that it holds back are sent and read, or `longest` after its replacement. The
// remaining frames then count as dropped. Used by one thread, which is not the sampling thread.
class LeavingPorts {
 public:
  static constexpr Nanoseconds longest = std::chrono::seconds(2);

  // Takes over the ports of an executed reload. `channels` outlive this.
  void add(Reload& reload, std::span<const std::unique_ptr<Channel>> channels);
  // Closes the ports that can be closed now.
  void update();
  // Closes all ports, after 50 ms at the latest. Called at the end of the run.
  void finish();
  // Returns true if a port of that address waits here.
  bool has(const std::string& port) const;

 private:
  struct Leaving {
    Reload::Line line;
    Channel* channel;
    PortCounters before;  // counters when the port was replaced
    HostTime last;        // when the port is closed at the latest
  };
  static bool has_left(Leaving& leaving) noexcept;
  static void close(Leaving& leaving);

  std::vector<Leaving> all_;
};

}  // namespace imud
