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

  // Opens the files, and adds them and the further inputs to `in_use`. `port`: the text of the input. Throws
  // std::runtime_error or std::invalid_argument with the fault and the remedy; as TruthBeside does, too.
  MeasurementFiles(const Options& options, const Protocol& protocol, const std::string& port, FilesInUse& in_use);

  void write(const Measurement& measurement);
  // Writes all rows so that the files are complete, at most once a second.
  void flush();
  // Ends the files. Returns a text about the missing part of the truth; empty if no truth is missing. Throws
  // std::runtime_error, which names the first file that could not be written, or as TruthBeside::finish() does.
  std::string finish();

 private:
  const unsigned absent_rates_;
  std::unique_ptr<TruthBeside> truth_;
  std::vector<std::unique_ptr<RowOutput>> files_;
  HostTime flushed_;
};

}  // namespace imud
