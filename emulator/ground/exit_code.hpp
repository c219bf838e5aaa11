// The exit code of several runs together.
#pragma once

#include <algorithm>

namespace imud {

// Returns the worse of two exit codes: 1 is worse than 3, and 3 than 0.
inline int worse_exit_code(int a, int b) noexcept { return a == 1 || b == 1 ? 1 : std::max(a, b); }

}  // namespace imud
