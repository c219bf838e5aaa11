// measure_rack(): measures many sensors on one thread of this machine, in the loop of a real run.
#pragma once

#include <cstddef>

#include "core/numbers/duration_histogram.hpp"
#include "emulator/plan/config.hpp"

namespace imud {

struct RackFigures {
  DurationHistogram lateness;  // s, of the sensor whose 99th percentile is the greatest
  double processor_s = 0;      // of the sampling thread, for each sample
  std::uint64_t samples = 0;
};

// Runs `count` sensors at rest for `duration_s`, with native frames at `rate_hz`. Their instants are equally spaced
// within a period. Each sensor has its own pty in `folder`; another thread reads all ptys. The sampling thread is set
// up by `realtime`. Throws PortError.
RackFigures measure_rack(const RealtimeConfig& realtime, std::size_t count, double rate_hz, double duration_s,
                         const std::string& folder);

}  // namespace imud
