// Instants of tests of one clock against another, in seconds.
#pragma once

#include "core/time.hpp"

namespace imud {

constexpr HostTime host_begin{5'000'000'000};
inline HostTime host(double s) { return host_begin + nanoseconds(s); }
inline TruthTime truth(double s) { return TruthTime{} + nanoseconds(s); }

}  // namespace imud
