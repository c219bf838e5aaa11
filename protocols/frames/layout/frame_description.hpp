// FrameDescription: the description of a serial sensor's frames from the file of protocol `frame` (README.md), as
// plain text and numbers. The reader of the file makes this description, and FrameLayout compiles it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "core/time.hpp"
#include "core/uart.hpp"
#include "protocols/frames/layout/frame_host_description.hpp"
#include "protocols/wire/crc.hpp"

namespace imud {

// The framing of all messages (protocols/frames/frame_escape.hpp).
enum class FrameEscape : std::uint8_t { none, slip, hdlc, dle, cobs };

struct FrameDescription {
  // Limits of a file, which bound memory and time.
  static constexpr std::size_t most_messages = 64;
  static constexpr std::size_t most_elements = 512;       // of a message
  static constexpr std::size_t longest_element = 512;     // characters
  static constexpr std::size_t longest_frame = 4096;      // bytes
  static constexpr std::size_t longest_text = 4096;       // characters of a text message
  static constexpr std::size_t most_tests = 64;           // of a message
  static constexpr std::size_t most_checks = 64;          // own algorithms
  static constexpr std::uint64_t most_samples = 1 << 20;  // of a divider
  static constexpr std::size_t most_phases = 1024;        // of a message

  struct Text {
    std::string text;
    std::uint32_t line = 0;
  };
  struct Value {
    std::string name;  // of a quantity with its unit, of a counter, or of a bit of the status
    double value = 0;
    std::uint32_t line = 0;
  };
  struct Check {
    std::string name;
    CrcParameters parameters;
  };
  // A frame as a unit has sent it, and the values in the frame; values that are not listed are 0.
  struct Test {
    Text frame;  // in hexadecimal, or the line of text
    std::vector<Value> values;
    std::vector<FrameHostDescription::Choice> settings = {};  // of the unit at this frame; others are as delivered
  };
  struct Message {
    std::string name;
    std::uint32_t line = 0;
    bool is_big = false;  // the byte order of numbers whose element states none
    double rate_hz = 0;   // 0: by the divider
    // Sent with each sample whose number since the start is one of the phases + k * divider.
    std::uint64_t divider = 1;
    std::vector<std::uint64_t> phases = {0};  // ascending, less than the divider
    std::vector<Text> layout;
    std::optional<Text> text;  // a line of text, in place of the layout
    std::vector<Test> tests;

    std::string rate_setting;                        // the setting with the rate; empty: `rate_hz`
    std::vector<FrameHostDescription::Choice> when;  // sent while all of these hold
    bool is_streamed = true;                         // false: only sent when a request polls it
  };

  // The start-up after power on. Times count from power on.
  struct Start {
    Nanoseconds silent{};  // until then nothing is sent
    Nanoseconds until{};   // until then the bit `starting` is set; 0, or more than `silent`
    std::byte pattern{};   // until then, each byte of rates, specific forces and increments; 0: no pattern
  };

  std::string file;      // its path, or the name of a shipped description
  std::string name;      // of the product
  std::string document;  // with its edition
  std::string model;     // the preset of the emulator that has the product's errors; empty: none is known
  double rate_hz = 0;    // of the samples, if the configuration has no rate; 0: not given
  UartSettings uart;     // baud 0: not given
  Start start;
  FrameEscape escape = FrameEscape::none;
  std::vector<Check> checks;
  std::vector<Message> messages;

  FrameHostDescription host;
  std::string baud_setting;  // the setting with the bit rate of the line; empty: `uart`
};

// Returns true if the name of a description is the path of a file; false if it is the name of a shipped
// description.
inline bool is_path_of_frames(std::string_view name) noexcept {
  return name.find('/') != std::string_view::npos || name.ends_with(".toml");
}

// A fault of a description, and its remedy.
struct FrameFault {
  std::uint32_t line = 0;  // 0: not known
  std::string where;       // the message, and the element or key in it
  std::string what;
};

// Returns the fault's place: the message and a key or element of it.
std::string where_in(const FrameDescription::Message& message, const std::string& key);

// All faults of a description; what() gives the first fault.
struct FrameFaults : std::invalid_argument {
  FrameFaults(std::string_view file, std::vector<FrameFault> all);
  std::vector<FrameFault> faults;  // at least one
};

}  // namespace imud
