// stop_signal: turns SIGINT and SIGTERM into a flag that the loops of a program check.
#pragma once

namespace imud {

// Makes SIGINT and SIGTERM set stop_wished() and interrupt waiting system calls, and makes write() return an error
// for a closed pipe.
void catch_stop_signals();

bool stop_wished() noexcept;

}  // namespace imud
