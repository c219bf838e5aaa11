// Hosts: the descriptors of a run, and the host's bytes and deadlines that become steps.
#pragma once

#include <poll.h>

#include <optional>
#include <span>
#include <vector>

#include "emulator/engine/engine.hpp"
#include "emulator/ground/host.hpp"

namespace imud {

// Reads the ports of the imus' hosts, and proposes their bytes as steps. Allocates only in the constructor. One
// thread.
class Hosts {
 public:
  // `clock` measures the durations from the arrivals to the ends of the writes of the replies; nullptr: they are not
  // measured.
  Hosts(Engine& engine, Host* clock);

  // Returns the descriptors for ::poll(): first the truth's, disabled unless `truth`, then the hosts'.
  std::span<pollfd> inputs(bool truth) noexcept;
  // Serves the hosts for which ::poll() has reported an event in inputs(). Returns false if ::poll() would return at
  // once again, because of a lasting error or a flood.
  bool serve_inputs(HostTime now) noexcept;
  // Serves a host, or all of them. Lost ports check whether their device is back.
  bool serve(Channel& channel, HostTime now) noexcept;
  void serve_all(HostTime now) noexcept;
  // Polls the deadlines up to `now`, and sends frames that ports hold back; flush() does only the latter.
  void poll(HostTime now) noexcept;
  void flush() noexcept;
  // Returns when poll() has to be called next; nullopt if nothing waits for a time.
  std::optional<HostTime> next_wake() const noexcept;

 private:
  Engine& engine_;
  Host* const clock_;
  std::vector<pollfd> inputs_;
};

}  // namespace imud
