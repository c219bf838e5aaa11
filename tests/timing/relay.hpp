// The latency from a truth to its measurement, compared with a bare relay.
#pragma once

#include "tests/timing/rig.hpp"

namespace imud::timing {

// Latencies in us, from before the send() of a truth to after the read() of the first bytes of its measurement.
// Thousands of truths to imud in lockstep alternate with thousands to a relay: a process that receives a datagram and
// writes as many bytes as imud to a pty; and to a relay that makes imud's system calls: it waits for the datagram and
// for the pty's reader by ppoll(), and then receives without waiting. `sampling`: to a relay that decodes the truth
// and takes the step of the sensor model besides, but has no faults, counters, hosts or record. `spinning`: to imud
// with realtime.spin_us = 1000, so that it does not sleep before the next truth.
struct Latencies {
  std::vector<double> imud, spinning, relay, polling, sampling;
};
Latencies measure_latency(const Folder& folder, int steps);

}  // namespace imud::timing
