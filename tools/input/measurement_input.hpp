// measurement_input: for programs that decode any protocol from any port.
#pragma once

#include <CLI/CLI.hpp>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/time.hpp"
#include "protocols/protocol.hpp"
#include "transports/file/files_in_use.hpp"
#include "transports/port.hpp"

namespace imud {

// The part of a command line that selects the input.
struct DecodeOptions {
  std::string program = {};                                         // its name, for messages
  std::string protocol = {};                                        // name
  std::string port = {};                                            // text of a port
  std::vector<std::string> settings = {};                           // KEY=VALUE
  double for_s = std::numeric_limits<double>::infinity();           // of the host's clock
  std::uint64_t count = std::numeric_limits<std::uint64_t>::max();  // samples

  // Makes "-" a port of the protocol's link that reads standard input, and the path of a file a port that reads it.
  void resolve_port();
};

// Adds PORT, --set, --frame-file, --for and --count, which every program that decodes has, to a command line.
void add_input_options(CLI::App& app, DecodeOptions& options);

// Adds the files that the command line of the input names: the port's, and a setting's, such as frame_file.
void add_input_files(const DecodeOptions& options, FilesInUse& files);
// Adds the file that a PRESET|FILE.toml names.
void add_model_file(const std::string& model, const std::string& option, FilesInUse& files);

// Return lists of the choices, for the help of a command line.
std::string known_protocols();
std::string known_ports();

// Returns the protocol. Throws std::invalid_argument if there is no protocol of that name, or if the port cannot
// carry the protocol.
const Protocol& protocol_for(const DecodeOptions& options);

// Receives the measurements of receive_all().
class MeasurementReceiver : public MeasurementSink {
 public:
  // Called before the measurements that arrived together. `arrival`: see StreamStatistics::add().
  virtual void set_arrival(std::optional<HostTime> arrival) = 0;
  // Returns true if the receiver has as many samples as it wants.
  virtual bool is_full() const = 0;
  // Returns false if the receiver has no use for further measurements.
  virtual bool is_open() const { return true; }
  // Called before the program waits for input.
  virtual void flush() {}

 protected:
  ~MeasurementReceiver() = default;
};

// Decodes the port's input until it ends, the time or the number of samples is reached, the receiver is not open
// any more, or a signal comes; returns which: "end of input", "time", "count", "closed output", "signal". Reports
// on standard error when the device is lost, and when the device is back.
std::string_view receive_all(Port& port, Decoder& decoder, MeasurementReceiver& receiver,
                             const DecodeOptions& options);

}  // namespace imud
