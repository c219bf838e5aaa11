// StreamReport: what imu-decode says at the end, as text and as JSON.
#pragma once

#include <string>

#include "protocols/protocol.hpp"
#include "tools/stream_statistics.hpp"
#include "transports/port.hpp"

namespace imud {

struct StreamReport {
  const Protocol& protocol;
  std::string port;                    // as on the command line
  const StreamStatistics& statistics;  // finished
  DecodeErrors errors;
  PortCounters counters;
  std::string warning;   // of the port's end; usually empty
  std::string ended_by;  // end of input, signal, time, count, closed output

  // A line per subject, what is usual first; lines about what went wrong only if it did.
  std::string text() const;
  // One object; a quantity that is not known is null.
  std::string json() const;
};

}  // namespace imud
