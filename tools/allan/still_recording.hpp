// StillRecording: the rates and specific forces of a sensor at rest, equally spaced.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "protocols/measurements/npy_file.hpp"
#include "protocols/protocol.hpp"
#include "tools/allan/sample_store.hpp"
#include "tools/input/measurement_input.hpp"
#include "tools/stream_statistics.hpp"

namespace imud {

// The channels' names, as the columns of measurement CSV.
inline constexpr std::array<std::string_view, 6> channel_names = {"gyro_x",  "gyro_y",  "gyro_z",
                                                                  "accel_x", "accel_y", "accel_z"};
inline constexpr std::size_t channels_per_sensor = 3;

struct StillRecording {
  struct Channel {
    std::size_t number = 0;  // index in channel_names
    SampleStore values;      // rad/s, m/s^2
    // The values are increments multiplied by the rate.
    bool is_increment = false;
    bool is_rate() const noexcept { return number < channels_per_sensor; }
    std::string_view name() const noexcept { return channel_names[number]; }
  };
  std::vector<Channel> channels;  // of equal length, at least shortest_recording, all finite
  double rate_hz = 0;
  std::string rate_source;  // "device clock"
  std::uint64_t gaps = 0, missing = 0, repeated = 0, invalid = 0, time_jumps = 0;
  bool can_detect_gaps = true;

  std::size_t samples() const noexcept { return channels.empty() ? 0 : channels.front().values.size(); }
};

inline constexpr std::size_t shortest_recording = 32;

struct RecordingOptions {
  std::optional<double> rate_hz;  // replaces the rate by the device's clock
  bool increments = false;        // delta-angle and delta-velocity in place of rate and specific force
  double largest_missing = 0.1;   // percent of the samples that may be missing, repeated or invalid
};

// Makes a recording of decoded measurements. If the measurements have no rates, their increments divided by the
// period are recorded. Samples that the device marks as invalid are omitted; invalid samples before the first
// valid sample are the start-up of the device and do not count as missing. A sample that has other components than
// the first one is invalid.
class StillRecorder final : public MeasurementReceiver {
 public:
  StillRecorder(const Protocol& protocol, const RecordingOptions& options, std::uint64_t wanted);

  void on_measurement(const Measurement& measurement) override;
  void set_arrival(std::optional<HostTime> arrival) override { arrival_ = arrival; }
  bool is_full() const override { return taken_ >= wanted_; }

  // Ends the recording; call it once. Samples around a gap are joined, as if no sample were missing. This has no
  // effect on white noise, and little effect on other noise as long as few samples are missing. Throws
  // std::runtime_error, with the remedy, if too many are missing, the device restarted, the rate is unknown, or
  // there are too few samples.
  StillRecording finish();

 private:
  void choose_channels(const Measurement& first);
  // Return the recorded vectors of a sample, or its increments over a period.
  const Vector3& rates_of(const Sample& sample) const noexcept;
  const Vector3& forces_of(const Sample& sample) const noexcept;
  double value_of(const StillRecording::Channel& channel, const Sample& sample) const noexcept;
  // Returns true if the sample has a number on each recorded channel, and on no other channel of these vectors.
  bool has_the_channels(const Sample& sample) const noexcept;

  const RecordingOptions options_;
  const std::uint64_t wanted_;
  StreamStatistics statistics_;
  std::optional<HostTime> arrival_;
  std::uint32_t fields_ = 0;  // recorded fields; 0 before the first sample
  std::uint64_t taken_ = 0;
  StillRecording recording_;
};

// Makes a recording of an array with these `columns`; nullopt: the column is omitted. Throws as
// StillRecorder::finish(), and if a value is not finite.
StillRecording recording_of(NpyRows& array, const std::vector<std::optional<std::size_t>>& columns, double rate_hz);

// Returns the channels of the texts "gyro_x,gyro_y,-,accel_x"; an empty text stands for the six channels, or for the
// first of them, according to the number of columns. Throws std::invalid_argument.
std::vector<std::optional<std::size_t>> parse_columns(std::string_view text, std::size_t columns);

}  // namespace imud
