// Monitor: says what the thread that samples may not say itself.
#pragma once

#include <array>
#include <fstream>
#include <string>
#include <vector>

#include "emulator/summary.hpp"
#include "transports/host_clock.hpp"

namespace imud {

// Looks at the session's counters now and then, from another thread than the one that samples.
class Monitor {
 public:
  struct Options {
    double log_every_s = 10;   // a line with the figures since the one before; 0: none
    std::string quality_file;  // a line of JSON a second; empty: none
  };
  // Throws std::runtime_error if the file cannot be written.
  Monitor(const Session& session, const Config& config, const Options& options);

  // Logs what has happened since the last look, once each. To be called some ten times a second.
  void look();
  // When the thread that samples has ended: likewise, and the figures of the whole run.
  Summary finish();

 private:
  void say_truth();
  void say_ports();
  Summary now() const;

  const Session& session_;
  const Config& config_;
  const Options options_;
  const HostTime begin_ = host_now();
  std::vector<double> line_loads_;
  std::ofstream quality_;
  Summary last_quality_, last_log_;  // what was said then
  std::vector<PortState> states_;    // as last said, likewise the following
  std::vector<int> wrong_speeds_;    // how often said
  std::array<bool, static_cast<std::size_t>(Refusal::count)> named_ = {};
  std::uint64_t runs_ = 0, stops_ = 0, returns_ = 0, resumed_ = 0;
};

}  // namespace imud
