// Counts what the test program allocates: `operator new` is replaced (allocation_count.cpp).
#pragma once

#include <cstdint>

namespace imud {

// Allocations since the program's start.
std::uint64_t allocation_count() noexcept;

}  // namespace imud
