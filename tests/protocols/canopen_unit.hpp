// A CANopen device under test, whose frames are text as candump writes it, separated by blanks.
#pragma once

#include <gtest/gtest.h>

#include <cstring>
#include <memory>
#include <sstream>
#include <string>
#include <vector>

#include "tests/protocols/can_text.hpp"
#include "tests/protocols/recording.hpp"

namespace imud::canopen_test {

using namespace std::chrono_literals;

struct Unit {
  // Without a start-up time, unless the settings have one.
  explicit Unit(const std::string& settings = "")
      : protocol(protocol_named("canopen")),
        device(protocol.make(settings_of(protocol, "start_up_ms=0 " + settings))) {
    sample.rate = {0.25, -0.5, 1};
    sample.specific_force = {1, -2, -9.75};
  }

  // Frames that arrive now; returns the answers.
  std::string send(std::string_view text) {
    std::string sent;
    each_frame(text, [&](const Frame& frame) {
      frames->clear();
      device->receive(frame, now, *frames);
      collect(sent);
    });
    return sent;
  }
  // Time that passes without samples; returns what the device sends on its own.
  std::string pass(Nanoseconds time) {
    std::string sent;
    const DeviceTime end = now + time;
    for (auto due = device->deadline(); due && *due <= end; due = device->deadline()) {
      now = std::max(now, *due);
      frames->clear();
      device->poll(now, *frames);
      EXPECT_GT(device->deadline().value_or(now + 1ns), now);
      collect(sent);
    }
    now = end;
    return sent;
  }
  // A sample after `time`; returns what is sent until then, and with it.
  std::string step(Nanoseconds time = 10ms) {
    std::string sent = pass(time);
    sample.time = now;
    frames->clear();
    device->sample(sample, *frames);
    ++sample.counter;
    collect(sent);
    return sent;
  }

  // SDO, expedited. `size` bytes of `value` are written; returns the abort code, or 0.
  std::uint32_t write(unsigned index, unsigned sub, std::uint64_t value, unsigned size) {
    return abort_of(send(request(0x23 | (4 - size) << 2, index, sub, value)));
  }
  // Returns the value of an object of at most 4 bytes; expects that it can be read.
  std::uint32_t read(unsigned index, unsigned sub = 0) {
    const std::string answer = send(request(0x40, index, sub, 0));
    EXPECT_EQ(answer.substr(4, 1), "4") << answer;
    return number(answer.substr(12));
  }
  std::uint32_t read_abort(unsigned index, unsigned sub) { return abort_of(send(request(0x40, index, sub, 0))); }

  std::string request(unsigned command, unsigned index, unsigned sub, std::uint64_t value) const {
    char text[64];
    std::snprintf(text, sizeof text, "%03X#%02X%02X%02X%02X%02X%02X%02X%02X", 0x600 + node_id, command, index & 0xFFU,
                  index >> 8, sub, static_cast<unsigned>(value & 0xFF), static_cast<unsigned>(value >> 8 & 0xFF),
                  static_cast<unsigned>(value >> 16 & 0xFF), static_cast<unsigned>(value >> 24 & 0xFF));
    return text;
  }
  // Little-endian, from hexadecimal digits.
  static std::uint32_t number(const std::string& digits) {
    std::uint32_t value = 0;
    for (std::size_t i = digits.size(); i >= 2; i -= 2)
      value = value << 8 | static_cast<std::uint32_t>(std::stoul(digits.substr(i - 2, 2), nullptr, 16));
    return value;
  }
  std::uint32_t abort_of(const std::string& answer) const {
    return answer.size() == 20 && answer.substr(4, 2) == "80" ? number(answer.substr(12)) : answer.empty() ? 1 : 0;
  }
  std::uint64_t count(std::string_view key) const {
    for (std::size_t i = 0; i < protocol.counters.size(); ++i)
      if (protocol.counters[i].key == key) return device->counts()[i];
    throw std::logic_error("no such counter");
  }

  const Protocol& protocol;
  std::unique_ptr<Device> device;
  DeviceTime now;
  Sample sample;
  unsigned node_id = 10;

 private:
  void collect(std::string& sent) {
    for (const Frame& frame : frames->frames()) sent += (sent.empty() ? "" : " ") + can_text(frame);
  }
  std::unique_ptr<FrameBuffer> frames = std::make_unique<FrameBuffer>();
};

}  // namespace imud::canopen_test
