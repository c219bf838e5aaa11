// A MIP device under test, and packets to and from it.
#pragma once

#include <algorithm>
#include <cstring>
#include <memory>
#include <string>
#include <vector>

#include "core/earth/earth.hpp"
#include "core/gps_time.hpp"
#include "core/units.hpp"
#include "protocols/protocol.hpp"

namespace imud::mip_test {

using namespace std::chrono_literals;
using Bytes = std::vector<std::uint8_t>;

// Field descriptors: increments of the sensor set, and times of any set.
constexpr std::uint8_t delta_angle = 0x07, delta_velocity = 0x08, ticks = 0xD1, delta_ticks = 0xD2, gps_time = 0xD3,
                       delta_time = 0xD4, reference = 0xD5, reference_delta = 0xD6;

inline Bytes hex(std::string_view text) {
  Bytes bytes;
  for (std::size_t i = 0; i + 1 < text.size(); i += 2)
    bytes.push_back(static_cast<std::uint8_t>(std::stoul(std::string(text.substr(i, 2)), nullptr, 16)));
  return bytes;
}

// Adds header and checksum, which is computed independently.
inline Bytes packet(std::uint8_t set, const Bytes& fields) {
  Bytes all = {0x75, 0x65, set, static_cast<std::uint8_t>(fields.size())};
  for (const std::uint8_t byte : fields) all.push_back(byte);
  unsigned a = 0, b = 0;
  for (const std::uint8_t byte : all) b += a += byte;
  all.push_back(static_cast<std::uint8_t>(a));
  all.push_back(static_cast<std::uint8_t>(b));
  return all;
}
inline Bytes command(std::uint8_t set, std::uint8_t descriptor, Bytes data = {}) {
  data.insert(data.begin(), {static_cast<std::uint8_t>(data.size() + 2), descriptor});
  return packet(set, data);
}

// A device with its clock, which is advanced by samples, one per millisecond, and by wait(). Its deadlines are
// polled. It is a 3DM-CV7-AHRS, which has the shared fields, unless another model is given.
class Unit {
 public:
  explicit Unit(std::initializer_list<std::pair<std::string_view, SettingValue>> values = {}) {
    const Protocol& protocol = *find_protocol("mip");
    Settings settings(protocol.settings);
    settings.set("model", std::string("3dm-cv7-ahrs"));
    for (const auto& [key, value] : values) settings.set(key, value);
    device = protocol.make(settings);
  }
  // The first sample is at `now`, each further one a millisecond later.
  std::vector<Bytes> run(int samples) {
    std::vector<Bytes> all;
    for (int k = 0; k < samples; ++k) {
      if (has_sampled_) append(all, wait(1ms));
      has_sampled_ = true;
      sample.counter = static_cast<std::uint64_t>(count_++) + sample.counter_error;
      sample.time = now;
      frames_->clear();
      device->sample(sample, *frames_);
      append(all, frames());
    }
    return all;
  }
  // Advances the clock without samples.
  std::vector<Bytes> wait(Nanoseconds duration) {
    std::vector<Bytes> all;
    const DeviceTime end = now + duration;
    for (int polls = 0; polls < 1000; ++polls) {
      const auto deadline = device->deadline();
      if (!deadline || *deadline > end) break;
      now = std::max(now, *deadline);
      append(all, poll());
    }
    now = end;
    return all;
  }
  std::vector<Bytes> poll() {
    frames_->clear();
    device->poll(now, *frames_);
    return frames();
  }
  std::vector<Bytes> send(const Bytes& bytes) {
    frames_->clear();
    device->receive({std::as_bytes(std::span(bytes))}, now, *frames_);
    return frames();
  }
  // Returns the code in the answer to the only command of the packet; -1: there is no answer.
  int code(const Bytes& bytes) {
    const auto answers = send(bytes);
    if (answers.empty() || answers[0].size() < 8 || answers[0][5] != 0xF1 || answers[0][6] != bytes[5]) return -1;
    return answers[0][7];
  }

  DeviceTime now;
  Sample sample;
  std::unique_ptr<Device> device;

 private:
  std::vector<Bytes> frames() const {
    std::vector<Bytes> all;
    for (const Frame& frame : frames_->frames()) {
      Bytes bytes(frame.bytes.size());
      std::memcpy(bytes.data(), frame.bytes.data(), bytes.size());
      all.push_back(std::move(bytes));
    }
    return all;
  }
  static void append(std::vector<Bytes>& all, const std::vector<Bytes>& more) {
    all.insert(all.end(), more.begin(), more.end());
  }
  bool has_sampled_ = false;
  int count_ = 0;
  std::unique_ptr<FrameBuffer> frames_ = std::make_unique<FrameBuffer>();
};

// A sample over Boulder at 2026-03-04T05:06:07.250Z, to the north-west and up.
inline Sample over_boulder() {
  Sample sample;
  sample.navigation.is_known = true;
  sample.navigation.gps_ns = gps_ns_from_unix(1'772'600'767) + 250'000'000;
  sample.navigation.latitude = 40 * units::degree;
  sample.navigation.longitude = -105.25 * units::degree;
  sample.navigation.height = 1655;
  sample.navigation.v_L = {30, -40, -5};
  sample.pressure = 82'950;
  return sample;
}

// The data of a field of a packet; empty if the packet has no such field.
inline Bytes field(const Bytes& packet, std::uint8_t descriptor) {
  for (std::size_t at = 4; at + 2 < packet.size() - 2; at += packet[at]) {
    const auto begin = packet.begin() + static_cast<std::ptrdiff_t>(at);
    if (packet[at + 1] == descriptor) return {begin + 2, begin + packet[at]};
  }
  return {};
}
// The number of that type that begins at byte `at` of the data; 0 if they are too short.
template <class Number>
Number number_at(const Bytes& data, std::size_t at) {
  Number number = {};
  if (data.size() < at + sizeof number) return number;
  const auto begin = data.begin() + static_cast<std::ptrdiff_t>(at);
  Bytes turned(begin, begin + sizeof number);
  std::reverse(turned.begin(), turned.end());
  std::memcpy(&number, turned.data(), sizeof number);
  return number;
}
inline float number(const Bytes& data, std::size_t i) { return number_at<float>(data, 4 * i); }

}  // namespace imud::mip_test
