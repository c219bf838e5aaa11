// TruthBeside: the truth at each measurement of an imu, from its record, or from the configuration and the capture
// that it ran with.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "emulator/plan/config.hpp"
#include "emulator/record/measurement_rows.hpp"
#include "protocols/measurements/measurement_row.hpp"
#include "protocols/protocol.hpp"

namespace imud {

// Replays the capture (Replay), and keeps 120 bytes for each measurement in memory.
class TruthBeside {
 public:
  struct Options {
    std::string config, capture;  // as for `imud replay`; a record is both
    std::string imu;              // name; empty: the first with the protocol
  };
  // Throws as Replay does, std::invalid_argument if there is no such imu, and std::runtime_error if the imu sends
  // nothing.
  TruthBeside(const Options& options, const Protocol& protocol);

  // Returns the truth at the next measurement of the run with the same time and counter, as far as
  // the protocol carries them, within the next 65536; otherwise the truth at the run's next
  // measurement. NaN if there is none.
  TrueValues at(const MeasurementRow& row);

  // Call it after the last measurement. Returns a message if measurements have no truth, or if the order of
  // measurements without time and counter does not fit the run; otherwise an empty text. Throws std::runtime_error
  // if no measurement belongs to the run.
  std::string finish() const;

  const Config& config() const noexcept { return config_; }

 private:
  // The values that identify a measurement. A value that the protocol does not carry has its initial value here.
  struct Identity {
    std::int64_t time_ns = MeasurementRow::no_time;
    std::uint64_t counter = MeasurementRow::no_counter;
    bool operator==(const Identity&) const = default;
  };

  const Options options_;
  Config config_;
  std::vector<Identity> measured_;
  std::vector<TrueRow> truths_;
  std::size_t next_ = 0;
  std::uint64_t with_ = 0, without_ = 0;
  bool is_by_order_ = false;
};

}  // namespace imud
