// SIGINT and SIGTERM as a wish to end, for programs whose loops look at it.
#pragma once

namespace imud {

// Makes SIGINT and SIGTERM set stop_wished() and interrupt whatever waits, and a closed pipe an error of write().
void catch_stop_signals();

bool stop_wished() noexcept;

}  // namespace imud
