// Shared by the protocol tests: samples, copies of their frames, and the measurements that a decoder returned.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <memory>
#include <random>
#include <span>
#include <stdexcept>
#include <string_view>
#include <vector>

#include "protocols/protocol.hpp"

namespace imud {

// A frame that owns its bytes.
struct StoredFrame {
  std::vector<std::byte> bytes;
  CanHeader can;

  Frame view() const { return {bytes, can}; }
};

class Recording final : public MeasurementSink {
 public:
  explicit Recording(std::size_t expected = 4096) { measurements.reserve(expected); }
  void on_measurement(const Measurement& measurement) override { measurements.push_back(measurement); }

  std::vector<Measurement> measurements;
};

// "key=value key=value ..."; other settings have their initial values.
inline Settings settings_of(const Protocol& protocol, std::string_view texts) {
  Settings settings(protocol.settings);
  for (std::string_view rest = texts; !rest.empty();) {
    const std::string_view one = rest.substr(0, rest.find(' '));
    rest.remove_prefix(std::min(rest.size(), one.size() + 1));
    const std::size_t equals = one.find('=');
    settings.set_text(one.substr(0, equals), one.substr(equals + 1));
  }
  return settings;
}

// A device and its decoder, with the same settings.
class Line {
 public:
  explicit Line(const Protocol& protocol) : Line(protocol, Settings(protocol.settings)) {}
  Line(const Protocol& protocol, const Settings& settings)
      : device(protocol.make(settings)), decoder(protocol.make_decoder(settings)) {}

  // The frames of one sample; valid until the next call.
  std::span<const Frame> encode(const Sample& sample) {
    frames_->clear();
    device->sample(sample, *frames_);
    return frames_->frames();
  }

  std::vector<StoredFrame> encode_all(std::span<const Sample> samples) {
    std::vector<StoredFrame> stored;
    for (const Sample& sample : samples)
      for (const Frame& frame : encode(sample))
        stored.push_back({{frame.bytes.begin(), frame.bytes.end()}, frame.can});
    return stored;
  }

  void feed(std::span<const StoredFrame> frames, MeasurementSink& sink) {
    for (const StoredFrame& frame : frames) decoder->feed(frame.view(), sink);
  }

  std::unique_ptr<Device> device;
  std::unique_ptr<Decoder> decoder;

 private:
  std::unique_ptr<FrameBuffer> frames_ = std::make_unique<FrameBuffer>();
};

inline const Protocol& protocol_named(std::string_view name) {
  const Protocol* protocol = find_protocol(name);
  if (protocol == nullptr) throw std::logic_error("no protocol of this name");
  return *protocol;
}

inline std::vector<std::byte> concatenated(std::span<const StoredFrame> frames) {
  std::vector<std::byte> bytes;
  for (const StoredFrame& frame : frames) bytes.insert(bytes.end(), frame.bytes.begin(), frame.bytes.end());
  return bytes;
}

inline std::vector<std::byte> random_bytes(std::size_t count, std::mt19937_64& random) {
  std::vector<std::byte> bytes(count);
  for (std::byte& byte : bytes) byte = static_cast<std::byte>(random());
  return bytes;
}

// Samples within a protocol's range, times ascending.
inline std::vector<Sample> random_samples(std::size_t count, const Protocol& protocol, std::mt19937_64& random) {
  std::uniform_real_distribution<double> mantissa(-1.0, 1.0);
  std::uniform_int_distribution<int> decades(0, 12);
  const auto number = [&](double range) {
    return mantissa(random) * std::min(range, 1e9) * std::pow(10.0, -decades(random));
  };
  const auto vector = [&](double range) { return Vector3(number(range), number(range), number(range)); };
  std::vector<Sample> samples(count);
  std::int64_t time = 0;
  for (Sample& sample : samples) {
    time += 500'000 + static_cast<std::int64_t>(random() % 100'000'000);  // a line needs time to send a frame
    sample.time.ns = time;
    sample.counter = random();
    sample.rate = vector(protocol.range.rate);
    sample.specific_force = vector(protocol.range.specific_force);
    sample.delta_angle = vector(protocol.range.delta_angle);
    sample.delta_velocity = vector(protocol.range.delta_velocity);
    sample.temperature_c = number(protocol.range.temperature_c);
    sample.status = static_cast<std::uint32_t>(random());
  }
  return samples;
}

}  // namespace imud
