// stop_signal: turns SIGINT and SIGTERM into a flag that the loops of a program check.
#pragma once

#include <atomic>

namespace imud {

// Makes SIGINT and SIGTERM set stop_requested() and interrupt waiting system calls, and makes write() to a closed
// pipe return an error.
void catch_stop_signals();

// Return true after SIGINT or SIGTERM. Any thread.
bool stop_requested() noexcept;
const std::atomic<bool>& stop_flag() noexcept;
// Returns true after a second signal.
bool stop_requested_again() noexcept;

}  // namespace imud
