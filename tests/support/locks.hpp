// Counts the mutexes that a thread takes: `pthread_mutex_lock` and its kin are replaced (locks.cpp).
#pragma once

#include <cstdint>

namespace imud {

// From now on the calling thread's are counted.
void count_locks_of_this_thread() noexcept;
// Taken by the threads that are counted, since the program's start.
std::uint64_t locks_taken() noexcept;

}  // namespace imud
