// Shared by the tests of DroneCAN: a device with its clock, and frames as text.
#pragma once

#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <string_view>

#include "tests/protocols/can_text.hpp"
#include "tests/protocols/recording.hpp"

namespace imud::dronecan_test {

using namespace std::chrono_literals;

// Returns frames as text, separated by blanks.
inline std::string text_of(std::span<const Frame> frames) {
  std::string text;
  for (const Frame& frame : frames) text += (text.empty() ? "" : " ") + can_text(frame);
  return text;
}

class Unit {
 public:
  // `settings`: "key=value key=value"; the start-up is left out.
  explicit Unit(std::string_view settings = "")
      : settings_(settings_of(protocol_named("dronecan"), "start_up_ms=0")) {
    const std::string all = "start_up_ms=0 " + std::string(settings);
    settings_ =
        settings_of(protocol_named("dronecan"), std::string_view(all).substr(0, all.find_last_not_of(' ') + 1));
    device = protocol_named("dronecan").make(settings_);
  }

  // Returns the answer to frames that arrive now.
  std::string answer(std::string_view text) {
    std::string answer;
    each_frame(text, [&](const Frame& frame) {
      frames_->clear();
      device->receive(frame, now, *frames_);
      if (!frames_->frames().empty()) answer += (answer.empty() ? "" : " ") + text_of(frames_->frames());
    });
    return answer;
  }
  // Lets time pass; returns what the device sends on its own.
  std::string pass(Nanoseconds time) {
    std::string sent;
    const DeviceTime end = now + time;
    for (auto due = device->deadline(); due && *due <= end; due = device->deadline()) {
      now = *due;
      frames_->clear();
      device->poll(now, *frames_);
      EXPECT_GT(device->deadline().value_or(now + 1ns), now);
      if (!frames_->frames().empty()) sent += (sent.empty() ? "" : " ") + text_of(frames_->frames());
    }
    now = end;
    return sent;
  }
  // Returns the frames of a sample at the present time.
  std::string sample(Sample one = {}) {
    one.time = now;
    frames_->clear();
    device->sample(one, *frames_);
    return text_of(frames_->frames());
  }
  // Returns the measurements in the text.
  std::vector<Measurement> decoded(std::string_view text) {
    Recording recording;
    const auto decoder = protocol_named("dronecan").make_decoder(settings_);
    each_frame(text, [&](const Frame& frame) { decoder->feed(frame, recording); });
    return recording.measurements;
  }
  std::uint64_t count(std::string_view key) const {
    const auto& counters = protocol_named("dronecan").counters;
    for (std::size_t i = 0; i < counters.size(); ++i)
      if (counters[i].key == key) return device->counts()[i];
    throw std::logic_error("no such counter");
  }

  std::unique_ptr<Device> device;
  DeviceTime now;

 private:
  Settings settings_;
  std::unique_ptr<FrameBuffer> frames_ = std::make_unique<FrameBuffer>();
};

// Returns the number of frames in a text.
inline std::size_t frames_in(std::string_view text) {
  return static_cast<std::size_t>(std::ranges::count(text, '#'));
}

}  // namespace imud::dronecan_test
