// Clock: who says "now". Three loops over the same session, that differ in nothing else.
#pragma once

#include <atomic>
#include <optional>

#include "emulator/session.hpp"

namespace imud {

// Every loop returns when `stop` is set, within 20 ms, or when there is nothing more to do.

// A capture: read ahead of the samples. `paced`: each sample leaves when as much host time has passed since the run's
// first as simulation time; otherwise at once. Ends with the capture, or `limit` after the run's start.
void run_capture(Session& session, bool paced, std::optional<Nanoseconds> limit, const std::atomic<bool>& stop);

// Truth by UDP, each truth in turn lets the samples due up to its time leave, then is answered if it asks for that.
void run_lockstep(Session& session, const std::atomic<bool>& stop);

// Truth by UDP, samples at absolute instants of the host clock: the run's first truth is at its arrival plus `delay`.
// When a truth comes so late that motion is held (`extrapolate`), or more than a second early, the truth's clock has
// left the host's: a new run begins with it.
void run_realtime(Session& session, Nanoseconds delay, Nanoseconds extrapolate, const std::atomic<bool>& stop);

}  // namespace imud
