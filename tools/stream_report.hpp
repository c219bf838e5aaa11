// StreamReport: the closing report of imu-decode, as text and as JSON.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/requirement.hpp"
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
  std::vector<Requirement> required;

  // The figures that `--require` may limit; nullopt: the stream does not give the figure.
  struct Figure {
    std::string_view name;
    std::optional<double> value;
  };
  std::vector<Figure> figures() const;
  // Returns the value of the figure that the requirement is about. Throws std::invalid_argument if there is no
  // such figure.
  std::optional<double> seen(const Requirement& requirement) const;
  // Returns true if the figure is known and keeps the limit; a percentage is of the samples.
  bool holds(const Requirement& requirement) const;
  bool keeps_all_limits() const;

  // Returns a line for each subject; lines about faults, if there were any, are the last.
  std::string text() const;
  // Returns one object; an unknown quantity is null.
  std::string json() const;
};

}  // namespace imud
