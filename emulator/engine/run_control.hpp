// RunControl: the queues between the main thread and the sampling thread of a run that is controlled or watched.
#pragma once

#include <boost/lockfree/spsc_queue.hpp>
#include <cstddef>

#include "emulator/engine/command_queue.hpp"
#include "emulator/engine/run_events.hpp"
#include "emulator/engine/sample_feed.hpp"
#include "emulator/ground/counters.hpp"

namespace imud {

// Outlives the Engine that has it. All memory is allocated by the constructor.
struct RunControl {
  explicit RunControl(std::size_t imus)
      : applied(results), events(counters.events_overrun), feed(imus, counters.samples_overrun) {}

  static constexpr std::size_t results = 4096;  // of commands that the main thread has not read yet

  ControlCounters counters;
  CommandQueue commands;
  boost::lockfree::spsc_queue<Applied> applied;  // the answers to `commands`: for each batch one for each imu
  RunEvents events;
  SampleFeed feed;
};

}  // namespace imud
