// A CAN device under test, with its clock. Frames are text, as candump writes them (can_text.hpp).
#pragma once

#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "tests/protocols/can_text.hpp"
#include "tests/protocols/recording.hpp"

namespace imud {

using namespace std::chrono_literals;
using Texts = std::vector<std::string>;

// Returns the frames in one text, separated by blanks.
inline std::string joined(const Texts& frames) {
  std::string text;
  for (const std::string& frame : frames) text += (text.empty() ? "" : " ") + frame;
  return text;
}

class CanUnit {
 public:
  // `chosen`: "key=value key=value ...".
  CanUnit(std::string_view name, std::string_view chosen)
      : protocol(protocol_named(name)), settings(settings_of(protocol, chosen)), device(protocol.make(settings)) {}

  // Gives frames that arrive now to the device; returns its answers.
  Texts give(std::string_view text) {
    sent_.clear();
    each_frame(text, [&](const Frame& frame) { call([&] { device->receive(frame, now, *frames_); }); });
    return sent_;
  }
  // Lets time pass without samples; returns the frames that the device sends on its own.
  Texts pass(Nanoseconds time) {
    const DeviceTime end = now + time;
    sent_.clear();
    for (auto due = device->deadline(); due && *due <= end; due = device->deadline()) {
      now = std::max(now, *due);
      call([&] { device->poll(now, *frames_); });
      if (device->deadline().value_or(now + 1ns) <= now) {
        ADD_FAILURE() << "the deadline stays";
        break;
      }
    }
    now = end;
    return sent_;
  }
  // Gives a sample of the present time to the device; returns its frames.
  Texts sample(Sample sample = {}) {
    sample.time = now;
    sent_.clear();
    call([&] { device->sample(sample, *frames_); });
    return sent_;
  }
  std::uint64_t count(std::string_view key) const {
    const auto at = std::ranges::find(protocol.counters, key, &DeviceCounter::key);
    if (at == protocol.counters.end()) throw std::logic_error("no such counter");
    return device->counts()[static_cast<std::size_t>(at - protocol.counters.begin())];
  }

  const Protocol& protocol;
  const Settings settings;
  std::unique_ptr<Device> device;
  DeviceTime now;

 private:
  template <class Call>
  void call(Call&& call) {
    frames_->clear();
    call();
    for (const Frame& frame : frames_->frames()) sent_.push_back(can_text(frame));
  }

  Texts sent_;
  std::unique_ptr<FrameBuffer> frames_ = std::make_unique<FrameBuffer>();
};

}  // namespace imud
