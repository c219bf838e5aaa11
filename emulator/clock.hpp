// Clock: who says "now". Three loops over the same session, that differ in nothing else.
#pragma once

#include <atomic>
#include <optional>

#include "emulator/host.hpp"
#include "emulator/session.hpp"
#include "emulator/truth_clock.hpp"

namespace imud {

// Every loop returns when `stop` is set, within 20 ms, or when there is nothing more to do.

// A capture: read ahead of the samples. `paced`: each sample leaves when as much host time has passed since the run's
// first as simulation time, the last `spin` of it awake; otherwise at once. Ends with the capture, or `limit` after
// the run's start.
void run_capture(Session& session, Host& host, bool paced, Nanoseconds spin, std::optional<Nanoseconds> limit,
                 const std::atomic<bool>& stop);

// Truth by UDP, each truth in turn lets the samples due up to its time leave, then is answered if it asks for that.
void run_lockstep(Session& session, Host& host, const std::atomic<bool>& stop);

// Truth by UDP, samples at absolute instants of the host's clock, for ever: the grids start when the first truth has
// come and the delay has passed. What is sampled there the TruthClock says. When truths come, but so late that motion
// has been held for a while, or so early that the simulator's time must have leapt, a new run begins with the newest.
struct RealtimeOptions {
  TruthClock::Options truth;
  Nanoseconds extrapolate{0};  // after which motion is held
  Nanoseconds spin{0};         // awake so long before each instant
};
void run_realtime(Session& session, Host& host, const RealtimeOptions& options, const std::atomic<bool>& stop);

}  // namespace imud
