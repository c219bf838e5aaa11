// Host: the host's clock, and functions that wait by it. Tests replace it with a simulated one.
#pragma once

#include <poll.h>

#include <span>

#include "core/time.hpp"

namespace imud {

class Host {
 public:
  virtual ~Host() = default;
  // Returns the current time.
  virtual HostTime now() noexcept = 0;
  // Waits until `time`, and spins for the last `spin` of the wait, so that no wake-up delays the return. Returns the
  // time of the return.
  virtual HostTime sleep_until(HostTime time, Nanoseconds spin = {}) noexcept = 0;
  // Waits as poll() does until an input is ready, at most until `time`. Returns true if an input is ready.
  virtual bool wait_for_input(std::span<pollfd> inputs, HostTime time) noexcept = 0;
};

// The real host: CLOCK_MONOTONIC, clock_nanosleep() and ppoll().
class MonotonicHost final : public Host {
 public:
  // Must be made by the thread that will wait. Sets its timer slack to the minimum; otherwise the kernel adds up to
  // 50 us to every wait of a thread without priority.
  MonotonicHost() noexcept;
  HostTime now() noexcept override;
  HostTime sleep_until(HostTime time, Nanoseconds spin) noexcept override;
  bool wait_for_input(std::span<pollfd> inputs, HostTime time) noexcept override;
};

}  // namespace imud
