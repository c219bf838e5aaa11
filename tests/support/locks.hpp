// Counts the mutexes that a thread locks; `pthread_mutex_lock` and similar functions are replaced (locks.cpp).
#pragma once

#include <cstdint>

namespace imud {

// Starts counting on the calling thread.
void count_locks_of_this_thread() noexcept;
// Returns the number of mutexes locked by the counted threads since the program's start.
std::uint64_t locks_taken() noexcept;

}  // namespace imud
