// Host: the machine as the clocks see it: its time, and waiting for it. Tests simulate one.
#pragma once

#include <poll.h>

#include <span>

#include "core/time.hpp"

namespace imud {

class Host {
 public:
  virtual ~Host() = default;
  virtual HostTime now() noexcept = 0;
  // Until `time`, the last `spin` of it awake, which the scheduler cannot make late. Returns the time then.
  virtual HostTime sleep_until(HostTime time, Nanoseconds spin = {}) noexcept = 0;
  // Until `time`, or input, as poll() does. True if there is some.
  virtual bool wait_for_input(std::span<pollfd> inputs, HostTime time) noexcept = 0;
};

// CLOCK_MONOTONIC.
class MonotonicHost final : public Host {
 public:
  // For the thread that will wait: without it the kernel adds up to 50 us to every wait of an ordinary one.
  MonotonicHost() noexcept;
  HostTime now() noexcept override;
  HostTime sleep_until(HostTime time, Nanoseconds spin) noexcept override;
  bool wait_for_input(std::span<pollfd> inputs, HostTime time) noexcept override;
};

}  // namespace imud
