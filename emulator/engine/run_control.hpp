// RunControl: the queues between the main thread and the sampling thread of a run that is controlled or watched.
#pragma once

#include <atomic>
#include <boost/lockfree/spsc_queue.hpp>
#include <cstddef>
#include <cstdint>

#include "emulator/engine/command_queue.hpp"
#include "emulator/ground/counters.hpp"
#include "emulator/imu/sample_feed.hpp"

namespace imud {

struct Reload;

// A request to the sampling thread. Any thread makes it.
class Request {
 public:
  void make() noexcept { is_made_.store(true, std::memory_order_relaxed); }
  // Returns true once after a request. Sampling thread.
  bool take() noexcept {
    return is_made_.load(std::memory_order_relaxed) && is_made_.exchange(false, std::memory_order_relaxed);
  }

 private:
  std::atomic<bool> is_made_ = false;
};

// The event that a run of the truth has begun: the simulator has started, or has started again.
struct RunEvent {
  std::uint64_t sample = 0;  // Sample::counter of the first imu's first sample in the run
  std::int64_t time_ns = 0;  // the truth time at which the run begins
};

// The constructor allocates; neither thread waits or locks. An event for which there is no room is counted.
class RunEvents {
 public:
  static constexpr std::size_t capacity = 1024;

  // `lost` must outlive this.
  explicit RunEvents(Counter& lost) : events_(capacity), lost_(lost) {}
  // Sampling thread.
  void push(const RunEvent& event) noexcept {
    if (!events_.push(event)) lost_.count();
  }
  // Main thread.
  bool pop(RunEvent& event) noexcept { return events_.pop(event); }

 private:
  boost::lockfree::spsc_queue<RunEvent> events_;
  Counter& lost_;
};

// Must outlive the Engine that uses it. The constructor allocates all memory, except for the samples of the feed.
struct RunControl {
  explicit RunControl(std::size_t imus)
      : applied(results), events(counters.events_overrun), feed(imus, counters.samples_overrun) {}

  static constexpr std::size_t results = 4096;  // of commands that the main thread has not read yet

  ControlCounters counters;
  CommandQueue commands;
  boost::lockfree::spsc_queue<Applied> applied;  // the answers to `commands`: for each batch one for each imu
  // The changes of the next Command::Kind::reload; it outlives the command. Set by the thread that makes the command,
  // after the last reload was executed.
  Reload* reload = nullptr;
  RunEvents events;
  SampleFeed feed;
};

}  // namespace imud
