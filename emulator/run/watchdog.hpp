// Watchdog: reports to the service manager while the sampling thread works. Without reports the manager ends the
// run.
#pragma once

#include <atomic>
#include <boost/asio/io_context.hpp>
#include <boost/asio/steady_timer.hpp>
#include <chrono>
#include <cstdint>
#include <optional>

#include "emulator/ground/host.hpp"

namespace imud {

// The real host, which counts how often it is asked. The thread that samples asks it at least every 20 ms, also
// while it waits: in lockstep without truth, or in silence. The thread waits longer only for room in a port that is
// no file: up to 2 s after the port has last accepted something.
class CountingHost final : public Host {
 public:
  // Must be made by the thread that will wait, as MonotonicHost. `uses` has no other writer, and outlives this.
  explicit CountingHost(std::atomic<std::uint64_t>& uses) noexcept : uses_(uses) {}
  HostTime now() noexcept override { return counted().now(); }
  HostTime sleep_until(HostTime time, Nanoseconds spin) noexcept override {
    return counted().sleep_until(time, spin);
  }
  Ahead ahead(clockid_t clock) noexcept override { return host_.ahead(clock); }
  void reserve_inputs(std::size_t count) override { host_.reserve_inputs(count); }
  void watch(std::size_t input, int descriptor, short events, bool again) noexcept override {
    host_.watch(input, descriptor, events, again);
  }
  std::span<const Ready> wait_for_input(HostTime time, Nanoseconds spin) noexcept override {
    return counted().wait_for_input(time, spin);
  }

 private:
  MonotonicHost& counted() noexcept {
    uses_.store(uses_.load(std::memory_order_relaxed) + 1, std::memory_order_relaxed);
    return host_;
  }

  std::atomic<std::uint64_t>& uses_;
  MonotonicHost host_;
};

// Sends WATCHDOG=1 to the service manager four times in the time that it allows (WATCHDOG_USEC,
// sd_watchdog_enabled(3)), while `uses` changes. Before the first use it sends in any case, because the run may
// wait for the readers of its ptys. Does nothing if no manager asks for it. Used by the thread that runs `io`.
class Watchdog {
 public:
  // `is_always`: also sends while `uses` does not change, because a run that no clock paces uses its host only
  // when it waits.
  Watchdog(boost::asio::io_context& io, const std::atomic<std::uint64_t>& uses, bool is_always);

 private:
  void tick();

  boost::asio::steady_timer timer_;
  const std::atomic<std::uint64_t>& uses_;
  const bool is_always_;
  std::chrono::microseconds interval_{0};
  std::uint64_t seen_ = 0;
};

}  // namespace imud
