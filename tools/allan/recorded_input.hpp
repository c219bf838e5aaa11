// The recording of a sensor that the command line selects: from a port, or from an array in a file.
#pragma once

#include <CLI/CLI.hpp>
#include <stdexcept>
#include <string>
#include <string_view>

#include "tools/allan/still_recording.hpp"
#include "tools/input/measurement_input.hpp"
#include "tools/stop_signal.hpp"

namespace imud {

// The part of a command line that selects a recording. The protocol "npy" stands for an array, whose path is the
// port.
struct RecordedInput {
  DecodeOptions source;
  RecordingOptions recording;
  std::string columns;  // of an array

  bool is_array() const noexcept { return source.protocol == "npy"; }
};

// Adds PROTOCOL, PORT and the options of a recording. An option that has no effect on the kind of input that was
// given is an error of the command line.
void add_recorded_input(CLI::App& app, RecordedInput& input);

// Receives as receive_all(), or reads the array. Sets `running` when the port is open, and `ended_by`. Reports
// input that the decoder has not understood on standard error. Throws as StillRecorder::finish(), and
// std::invalid_argument if the array's file cannot be read or there is no rate.
StillRecording record(const RecordedInput& input, bool& running, std::string& ended_by);

// Runs act() on the input of a parsed command line. A fault before the input is open is a fault of the command
// line.
template <class Act>
int run_on(RecordedInput& input, bool& running, Act&& act) {
  catch_stop_signals();
  input.source.resolve_port();
  running = input.is_array();
  try {
    return act();
  } catch (const std::invalid_argument&) {
    running = false;
    throw;
  }
}

}  // namespace imud
