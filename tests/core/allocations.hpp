// The number of calls of operator new so far in this program (allocations.cpp replaces it), on any thread.
#pragma once

#include <cstdint>

namespace imud {
std::uint64_t allocations() noexcept;
}  // namespace imud
