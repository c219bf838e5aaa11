// Run: one whole run of the emulator, from opening the ports to the closing summary.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "emulator/record/record_file.hpp"
#include "emulator/report/monitor.hpp"

namespace imud {

struct RunOptions {
  // A file that an option of the command line names, such as `--summary`; - is standard output.
  struct Output {
    std::string option, path;
  };
  std::string config_file;           // its name on the command line, for clients; - is standard input
  std::vector<Output> outputs;       // all outputs; they must differ from one another and from the inputs
  std::optional<double> duration_s;  // host time; simulation time if the truth is a capture
  std::string summary_file;          // for the summary as JSON; - is standard output; empty: none
  std::string labels_file;           // for the labels of faults; - and empty as above
  std::string junit_file;            // for the expectations, as JUnit XML; - and empty as above
  std::vector<Requirement> required;
  std::optional<int> ready_fd;   // an open descriptor that report_ready() writes to and closes
  bool wait_for_reader = false;  // the run begins when each pty has a reader
  Monitor::Options monitor;
  RecordOptions record;
  std::optional<unsigned> threads;  // Assembly::Parts::threads; nullopt: 3 if there are two processors or more
  bool repeats = false;             // the truth port is a record, whose run is repeated
  // Reads the configuration again. Throws ConfigError. Empty: it cannot be read again.
  std::function<Config()> read_config;
};

// Runs until the capture ends, the duration is over, or SIGINT or SIGTERM arrives, and prints the summary. Returns
// Outcome::exit_code(). SIGUSR1 switches the devices' supply off and on, SIGHUP opens the file of `--quality` again,
// as log rotation needs it, and reads the configuration again (control/README.md, `reload`); SIGUSR2 is ignored.
// Throws PortError if a port cannot be opened, std::runtime_error if a file cannot be written, RequirementError if a
// requirement is about an unknown figure.
int run(const Config& config, const RunOptions& options);

}  // namespace imud
