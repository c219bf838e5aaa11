// MeasurementFiles: the files that imu-decode writes beside the CSV.
#pragma once

#include <CLI/CLI.hpp>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/time.hpp"
#include "tools/arrays/row_output.hpp"
#include "tools/arrays/truth_beside.hpp"
#include "transports/file/files_in_use.hpp"

namespace imud {

class MeasurementFiles {
 public:
  // The part of a command line that selects the files.
  struct Options {
    std::vector<std::string> paths;  // by format; empty: none
    std::string config;              // path of imud's configuration, for the attributes of files; empty: none
    std::optional<double> rate_hz;   // of measurements without time, for files that need one
    std::vector<std::string> truth;  // record, or configuration and capture; empty: no truth beside the measurements
    std::string imu;                 // imu of the configuration; empty: the first with the protocol
  };
  // `options` must not be moved until the command line has been parsed.
  static void add_options(CLI::App& app, Options& options);

  // Opens the output files, and enters their paths and the inputs of --config and --truth in `in_use`. `port`: the
  // port of the measurements, as on the command line. Throws std::runtime_error or std::invalid_argument with the
  // fault and the remedy, and the exceptions of TruthBeside's constructor.
  MeasurementFiles(const Options& options, const Protocol& protocol, const std::string& port, FilesInUse& in_use);

  void write(const Measurement& measurement);
  // Flushes each file (RowOutput::flush()). Does nothing if the last flush was less than a second ago.
  void flush();
  // Ends the files. Returns the message of TruthBeside::finish(), or an empty text without --truth. Throws
  // std::runtime_error, which names the first file that could not be written, and the exceptions of
  // TruthBeside::finish().
  std::string finish();

 private:
  std::unique_ptr<TruthBeside> truth_;
  std::vector<std::unique_ptr<RowOutput>> files_;
  HostTime flushed_;
};

}  // namespace imud
