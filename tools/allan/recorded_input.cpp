#include "tools/allan/recorded_input.hpp"

#include <fmt/format.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <stdexcept>

#include "emulator/plan/number_check.hpp"
#include "protocols/measurements/npy_file.hpp"
#include "tools/program.hpp"
#include "tools/setting_texts.hpp"
#include "transports/port.hpp"

namespace imud {
namespace {

StillRecording recorded_array(const DecodeOptions& input, const RecordingOptions& options,
                              const std::string& columns) {
  if (!options.rate_hz) throw std::invalid_argument("npy: the array has no time; right would be --rate-hz HZ");
  std::ifstream file(input.port, std::ios::binary);
  if (!file) throw std::invalid_argument(fmt::format("{}: cannot read it: {}", input.port, std::strerror(errno)));
  try {
    NpyRows array(file);
    return recording_of(array, parse_columns(columns, array.columns()), *options.rate_hz);
  } catch (const std::runtime_error& error) {
    throw std::runtime_error(fmt::format("{}: {}", input.port, error.what()));
  }
}

StillRecording recorded_port(const DecodeOptions& input, const RecordingOptions& options, bool& running,
                             std::string& ended_by) {
  const Protocol& protocol = protocol_for(input);
  const auto decoder = protocol.make_decoder(settings_from(protocol.settings, input.settings));
  const auto port = open_port(input.port, Role::listener);
  if (const std::string chosen = port->chosen_port(); !chosen.empty())
    fmt::print(stderr, "{}: receives at {}\n", input.program, chosen);
  running = true;
  StillRecorder recorder(protocol, options, input.count);
  ended_by = receive_all(*port, *decoder, recorder, input);
  if (const auto warning = port->end_warning(); !warning.empty())
    fmt::print(stderr, "{}: {}: {}\n", input.program, input.port, warning);
  const DecodeErrors& errors = decoder->errors();
  if (errors.checksum + errors.malformed + errors.incomplete > 0)
    fmt::print(stderr, "{}: {} checksum failures, {} malformed, {} incomplete\n", input.program, errors.checksum,
               errors.malformed, errors.incomplete);
  return recorder.finish();
}

}  // namespace

void add_recorded_input(CLI::App& app, RecordedInput& input) {
  add(app, "PROTOCOL", input.source.protocol, "",
      "protocol of the device, see below; npy: PORT is a file of numpy.save")
      ->required();
  add_input_options(app, input.source);
  add(app, "--rate-hz", input.recording.rate_hz, "HZ", "sample rate, in place of the device's clock")
      ->check(number_check(1e-6, 1e9));
  add(app, "--columns", input.columns, "NAMES",
      "channels of a NumPy array's columns, such as gyro_x,gyro_y,gyro_z,-; rad/s and m/s^2");
  app.add_flag("--increments", input.recording.increments,
               "uses delta-angle and delta-velocity even if the protocol has rate and specific force");
  add(app, "--max-missing", input.recording.largest_missing, "PERCENT",
      "largest percentage of samples that may be missing; default: 0.1")
      ->check(number_check(0, 100));
  app.parse_complete_callback([&app, &input] {
    if (!input.is_array()) {
      if (app.count("--columns") > 0) throw CLI::RequiresError("--columns", "npy");
      return;
    }
    for (const char* of_measurements : {"--set", "--frame-file", "--for", "--count", "--increments", "--max-missing"})
      if (app.count(of_measurements) > 0) throw CLI::ExcludesError("npy", of_measurements);
  });
}

StillRecording record(const RecordedInput& input, bool& running, std::string& ended_by) {
  ended_by = "end of input";
  StillRecording recording = input.is_array() ? recorded_array(input.source, input.recording, input.columns)
                                              : recorded_port(input.source, input.recording, running, ended_by);
  std::size_t bytes = 0;
  for (const auto& channel : recording.channels)
    if (channel.values.is_in_file()) bytes += channel.values.size() * sizeof(double);
  if (bytes > 0)
    fmt::print(stderr, "{}: {} MB of samples are in temporary files in {}, until the program ends\n",
               input.source.program, bytes / 1'000'000, SampleStore::folder());
  return recording;
}

}  // namespace imud
