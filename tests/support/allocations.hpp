// Counts what the test program allocates: `operator new` is replaced (allocations.cpp).
#pragma once

#include <cstdint>

namespace imud {

// Allocations since the program's start, on any thread.
std::uint64_t allocations() noexcept;

}  // namespace imud
