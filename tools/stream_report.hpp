// StreamReport: the closing report of imu-decode, as text and as JSON.
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

  // Returns a line for each subject; lines about faults, if there were any, are the last.
  std::string text() const;
  // Returns one object; an unknown quantity is null.
  std::string json() const;
};

}  // namespace imud
