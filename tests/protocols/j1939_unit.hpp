// A J1939 unit on a bus without other nodes than the test: frames are text, as candump writes them.
#pragma once

#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "tests/protocols/can_text.hpp"
#include "tests/protocols/recording.hpp"

namespace imud::j1939_test {

using namespace std::chrono_literals;
using Texts = std::vector<std::string>;

inline const std::string own_name = "0100E06600830080";  // the NAME of the initial settings

class Unit {
 public:
  // `settings`: "key=value key=value ...".
  explicit Unit(std::string_view settings = "")
      : protocol(protocol_named("j1939")), device(protocol.make(settings_of(protocol, settings))) {}

  // Lets time pass; returns the frames that the unit sends on its own.
  Texts pass(Nanoseconds time) {
    const DeviceTime end = now + time;
    sent_.clear();
    for (auto due = device->deadline(); due && *due <= end; due = device->deadline()) {
      now = std::max(now, *due);
      call([&] { device->poll(now, *frames_); });
    }
    now = end;
    return sent_;
  }
  // Gives frames to the unit; returns its answers.
  Texts give(std::string_view text) {
    sent_.clear();
    each_frame(text, [&](const Frame& frame) { call([&] { device->receive(frame, now, *frames_); }); });
    return sent_;
  }
  // Gives a sample of the present time to the unit; returns its frames.
  Texts sample(Sample sample = {}) {
    sample.time = now;
    sent_.clear();
    call([&] { device->sample(sample, *frames_); });
    return sent_;
  }
  // Takes samples at 100 Hz for a time; returns all frames.
  Texts run(Nanoseconds time) {
    Texts all;
    for (Nanoseconds passed{}; passed < time; passed += 10ms) {
      for (std::string& text : pass(10ms)) all.push_back(std::move(text));
      for (std::string& text : sample()) all.push_back(std::move(text));
    }
    return all;
  }
  std::uint64_t count(std::string_view key) const {
    const auto counters = protocol.counters;
    const auto at = std::ranges::find(counters, key, &DeviceCounter::key);
    EXPECT_NE(at, counters.end()) << key;
    return device->counts()[static_cast<std::size_t>(at - counters.begin())];
  }

  const Protocol& protocol;
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

// A unit that has claimed its address, and has had a sample.
class Claimed : public Unit {
 public:
  explicit Claimed(std::string_view settings = "") : Unit(settings) {
    pass(250ms);
    sample();
  }
};

inline std::size_t count_of(const Texts& texts, std::string_view begin) {
  return static_cast<std::size_t>(
      std::ranges::count_if(texts, [&](const std::string& text) { return text.starts_with(begin); }));
}

}  // namespace imud::j1939_test
