// The recording of a sensor by the command line: of a port, or of an array in a file.
#pragma once

#include <string>
#include <string_view>

#include "tools/allan/still_recording.hpp"
#include "tools/input/measurement_input.hpp"

namespace imud {

inline constexpr std::string_view array_file = "npy";  // in place of a protocol; the port is the path

// Throws std::invalid_argument if the file cannot be read or there is no rate, std::runtime_error if it is no
// recording.
StillRecording recorded_array(const DecodeOptions& input, const RecordingOptions& options,
                              const std::string& columns);

// Receives as receive_all(). Sets `running` when the port is open, and `ended_by`. Reports what the decoder has not
// understood on standard error. Throws as StillRecorder::finish().
StillRecording recorded_port(const DecodeOptions& input, const RecordingOptions& options, bool& running,
                             std::string& ended_by);

}  // namespace imud
