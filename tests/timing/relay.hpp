// How long a truth takes to become a measurement, against a bare relay.
#pragma once

#include "tests/timing/rig.hpp"

namespace imud::timing {

// us from before the truth's send() to after the read() of the measurement's first bytes, alternating by the thousand
// between imud in lockstep and a relay: a process that receives a datagram and writes as many bytes as imud to a pty.
struct Latencies {
  std::vector<double> imud, relay;
};
Latencies measure_latency(const Folder& folder, int steps);

}  // namespace imud::timing
