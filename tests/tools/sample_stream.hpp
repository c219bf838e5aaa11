// Streams of samples, and their bytes, as input for imu-decode.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/time.hpp"
#include "protocols/measurements/measurement_csv.hpp"
#include "tests/protocols/recording.hpp"

namespace imud {

// `count` samples at `rate_hz`, that differ in every quantity.
inline std::vector<Sample> steady_samples(std::size_t count, double rate_hz) {
  const Grid grid(rate_hz);
  std::vector<Sample> samples(count);
  for (std::size_t k = 0; k < count; ++k) {
    const double x = 1e-3 * static_cast<double>(k);
    samples[k].time = DeviceTime{} + grid.offset(k);
    samples[k].counter = k;
    samples[k].rate = {0.1 + x, -0.2, 0.3 / (1.0 + x)};
    samples[k].specific_force = {x, 1.0, -9.80665};
    samples[k].delta_angle = samples[k].rate / rate_hz;
    samples[k].delta_velocity = samples[k].specific_force / rate_hz;
    samples[k].status = static_cast<std::uint32_t>(k % 3);
  }
  return samples;
}

inline std::string text_of(std::span<const std::byte> bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

// One string per frame.
inline std::vector<std::string> frames_of(std::string_view protocol, std::span<const Sample> samples) {
  std::vector<std::string> frames;
  for (const StoredFrame& frame : Line(protocol_named(protocol)).encode_all(samples))
    frames.push_back(text_of(std::span<const std::byte>(frame.bytes)));
  return frames;
}

inline std::string bytes_of(std::string_view protocol, std::span<const Sample> samples) {
  std::string bytes;
  for (const std::string& frame : frames_of(protocol, samples)) bytes += frame;
  return bytes;
}

// Returns what imu-decode must print.
inline std::string csv_of(std::span<const Sample> samples) {
  std::string csv(measurement_csv_header);
  for (const Sample& sample : samples) {
    std::array<char, measurement_csv_row_max> row;
    csv.append(row.data(), write_measurement_csv({sample, Measurement::all}, row));
  }
  return csv;
}

}  // namespace imud
