// A CANopen device under test, whose frames are one text, separated by blanks.
#pragma once

#include <cstring>
#include <sstream>

#include "tests/protocols/can_unit.hpp"

namespace imud::canopen_test {

struct Unit : CanUnit {
  // The device has no start-up time, unless `chosen` sets one.
  explicit Unit(const std::string& chosen = "") : CanUnit("canopen", "start_up_ms=0 " + chosen) {
    sample.rate = {0.25, -0.5, 1};
    sample.specific_force = {1, -2, -9.75};
  }

  std::string send(std::string_view text) { return joined(give(text)); }
  std::string pass(Nanoseconds time) { return joined(CanUnit::pass(time)); }
  // Takes a sample after `time`. Returns the frames that are sent until then, and with the sample.
  std::string step(Nanoseconds time = 10ms) {
    Texts sent = CanUnit::pass(time);
    for (std::string& text : CanUnit::sample(sample)) sent.push_back(std::move(text));
    ++sample.counter;
    return joined(sent);
  }

  // Writes `size` bytes of `value` by an expedited SDO transfer. Returns the abort code; 0: none.
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

  Sample sample;
  unsigned node_id = 10;
};

}  // namespace imud::canopen_test
