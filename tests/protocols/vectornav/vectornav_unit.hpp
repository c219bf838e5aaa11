// A VectorNav under test, and its checksums, computed independently.
#pragma once

#include <gtest/gtest.h>

#include <array>
#include <boost/crc.hpp>
#include <cstring>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "protocols/protocol.hpp"

namespace imud::vectornav_test {

inline unsigned crc16(std::string_view text) {
  boost::crc_optimal<16, 0x1021, 0, 0, false, false> crc;
  crc.process_bytes(text.data(), text.size());
  return crc.checksum();
}
inline std::string hex_digits(unsigned number, int digits) {
  char text[16];
  std::snprintf(text, sizeof text, "%0*X", digits, number);
  return text;
}
inline std::string with_xor(std::string_view body) {
  unsigned sum = 0;
  for (const char c : body) sum ^= static_cast<unsigned char>(c);
  return "$" + std::string(body) + "*" + hex_digits(sum, 2) + "\r\n";
}
inline std::string with_crc(std::string_view body) {
  return "$" + std::string(body) + "*" + hex_digits(crc16(body), 4) + "\r\n";
}

// A device with its clock, which is advanced by samples, at the product's rate, and by wait().
class Unit {
 public:
  explicit Unit(std::initializer_list<std::pair<std::string_view, SettingValue>> values = {}) {
    const Protocol& protocol = *find_protocol("vectornav");
    Settings settings(protocol.settings);
    for (const auto& [key, value] : values) settings.set(key, value);
    device = protocol.make(settings);
    period = std::chrono::nanoseconds(static_cast<std::int64_t>(1e9 / protocol.product(settings).rate_hz));
    sample.specific_force = {0, 0, -9.80665};
  }
  // Frames by Frame::uart: those at the port, and those at the second port.
  using Sent = std::array<std::vector<std::string>, 2>;

  // The first sample is at `now`, each further one a period later. Returns the frames at the port; all others are
  // unexpected.
  std::vector<std::string> run(int samples) {
    Sent sent = run_both(samples);
    EXPECT_TRUE(sent[1].empty());
    return std::move(sent[0]);
  }
  Sent run_both(int samples) {
    Sent all;
    for (int k = 0; k < samples; ++k) {
      if (count_ > 0) wait(period);
      sample.counter = static_cast<std::uint64_t>(count_++);
      sample.time = now;
      frames_->clear();
      device->sample(sample, *frames_);
      append_frames(all);
    }
    return all;
  }
  // Advances the clock without samples.
  void wait(Nanoseconds duration) { now = now + duration; }
  // Returns the answers, all of which must leave at the UART at which the line came.
  std::string send(std::string_view line, std::uint8_t uart = 0) {
    frames_->clear();
    device->receive({std::as_bytes(std::span(line)), {}, uart}, now, *frames_);
    Sent all;
    append_frames(all);
    EXPECT_TRUE(all[1 - uart].empty());
    std::string text;
    for (const std::string& one : all[uart]) text += one;
    return text;
  }
  std::string ask(std::string_view body, std::uint8_t uart = 0) { return send(with_xor(body), uart); }

  DeviceTime now;
  Nanoseconds period{};
  Sample sample;
  std::unique_ptr<Device> device;

 private:
  void append_frames(Sent& all) const {
    for (const Frame& frame : frames_->frames()) {
      std::string text(frame.bytes.size(), '\0');
      std::memcpy(text.data(), frame.bytes.data(), text.size());
      all.at(frame.uart).push_back(std::move(text));
    }
  }
  int count_ = 0;
  std::unique_ptr<FrameBuffer> frames_ = std::make_unique<FrameBuffer>();
};

// The number of that type that begins at byte `at` of a binary frame; 0 if the frame is too short.
template <class Number>
Number number_at(const std::string& frame, std::size_t at) {
  Number number = {};
  if (frame.size() >= at + sizeof number) std::memcpy(&number, frame.data() + at, sizeof number);
  return number;
}
inline float real_at(const std::string& frame, std::size_t at) { return number_at<float>(frame, at); }

}  // namespace imud::vectornav_test
