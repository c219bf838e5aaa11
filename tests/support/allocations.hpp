// Counts the allocations of the test program, whose `operator new` is replaced (allocations.cpp).
#pragma once

#include <cstdint>

namespace imud {

// Returns the number of allocations since the program's start, on all threads.
std::uint64_t allocations() noexcept;

}  // namespace imud
