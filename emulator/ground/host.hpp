// Host: the host's clock, and functions that wait by it. Tests replace it with a simulated one.
#pragma once

#include <poll.h>
#include <sys/types.h>

#include <cstddef>
#include <span>
#include <vector>

#include "core/time.hpp"
#include "transports/file_descriptor.hpp"

namespace imud {

class Host {
 public:
  virtual ~Host() = default;
  // Returns the current time.
  virtual HostTime now() noexcept = 0;
  // Waits until `time`, and spins for the last `spin` of the wait, so that no wake-up delays the return. Returns the
  // time of the return.
  virtual HostTime sleep_until(HostTime time, Nanoseconds spin = {}) noexcept = 0;

  // How much the time of a clock, such as CLOCK_TAI, is ahead of now(), and the uncertainty of that, either way.
  struct Ahead {
    Nanoseconds by{0}, uncertainty{0};
  };
  virtual Ahead ahead(clockid_t clock) noexcept = 0;

  // --- Inputs, each with a number from 0 on ---
  // Makes room for that many inputs, of which none is watched. Allocates.
  virtual void reserve_inputs(std::size_t count) = 0;
  // From now on watches the descriptor for these events of poll(); 0: it is not watched. `again`: tells the kernel
  // even if nothing has changed, in case that another file has taken the descriptor's number.
  virtual void watch(std::size_t input, int descriptor, short events, bool again) noexcept = 0;
  struct Ready {
    std::size_t input = 0;
    short events = 0;  // as poll() reports them
  };
  // Waits until a watched input is ready, at most until `time`. Returns the ready ones, until the next call. For the
  // first `spin` of the wait the thread asks again and again without sleeping, so that no wake-up delays the return.
  virtual std::span<const Ready> wait_for_input(HostTime time, Nanoseconds spin = {}) noexcept = 0;
};

// The real host: CLOCK_MONOTONIC, clock_nanosleep(), and ppoll() for a few inputs or on epoll for many.
class MonotonicHost final : public Host {
 public:
  // Must be made by the thread that will wait. Sets its timer slack to the minimum; otherwise the kernel adds up to
  // 50 us to every wait of a thread without priority.
  MonotonicHost() noexcept;
  HostTime now() noexcept override;
  HostTime sleep_until(HostTime time, Nanoseconds spin) noexcept override;
  Ahead ahead(clockid_t clock) noexcept override;
  void reserve_inputs(std::size_t count) override;
  void watch(std::size_t input, int descriptor, short events, bool again) noexcept override;
  std::span<const Ready> wait_for_input(HostTime time, Nanoseconds spin) noexcept override;

 private:
  std::span<const Ready> poll_inputs(Nanoseconds at_most) noexcept;

  std::vector<pollfd> inputs_;  // by number; a descriptor of -1: it is not watched
  std::vector<Ready> ready_;
  FileDescriptor epoll_;   // of all inputs, if there are many
  bool has_file_ = false;  // an input is a file, of which epoll knows nothing and which is always ready
};

// Returns how many processors this process may use, at least 1: an affinity, such as a container's, limits them.
unsigned usable_processors() noexcept;

}  // namespace imud
