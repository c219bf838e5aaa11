// FrameHostDescription: the settings and requests in the file of protocol `frame` (README.md), as plain text and
// numbers.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace imud {

struct FrameHostDescription {
  // Limits of a file, which bound memory and time.
  static constexpr std::size_t most_settings = 64;
  static constexpr std::size_t most_values = 64;                        // of a setting
  static constexpr std::int64_t largest_value = std::int64_t{1} << 53;  // of a range; its smallest is the negative
  static constexpr std::size_t most_requests = 256;
  static constexpr std::size_t most_unknown = 16;
  static constexpr std::size_t most_items = 64;          // kinds, of a request
  static constexpr std::size_t most_tests = 16;          // of a request
  static constexpr std::size_t longest_line = 256;       // bytes, with its end
  static constexpr std::size_t longest_request = 1024;   // bytes, of any other request
  static constexpr std::size_t longest_answer = 1024;    // bytes
  static constexpr std::uint32_t longest_delay = 60000;  // ms

  struct Text {
    std::string text;
    std::uint32_t line = 0;
  };
  struct Setting {
    std::string name;
    std::uint32_t line = 0;
    std::vector<std::string> values;  // texts, or the shortest texts of numbers; empty for a range
    bool is_number = false;           // all values are numbers
    bool is_range = false;            // the values are all whole numbers from `lowest` to `highest`
    std::int64_t lowest = 0, highest = 0;
    std::vector<std::uint64_t> codes;  // of the values, in binary requests and answers; empty: the values themselves
    std::uint64_t delivered = 0;       // index of the value as delivered; of a range: its distance from `lowest`
    bool is_kept = false;              // a value that the host sets survives a loss of power
  };
  // A setting with one of several values, as a condition, or with one value that a request sets.
  struct Choice {
    std::string setting;
    std::vector<std::string> values;
    std::uint32_t line = 0;
  };
  // The answer of a unit: either text with captures, or elements. If there is neither, the unit does not answer.
  struct Answer {
    std::optional<Text> text;
    std::vector<Text> layout;
    bool is_given() const noexcept { return text.has_value() || !layout.empty(); }
  };
  struct Test {
    std::string request, answer;  // text, or bytes in hexadecimal
    std::uint32_t line = 0;
  };
  struct Request {
    std::uint32_t line = 0;
    std::optional<Text> text;  // a line; nullopt: `layout` has the bytes
    bool ignores_case = false;
    std::vector<Text> layout;
    std::vector<std::vector<Text>> items;  // the kinds of items for {items} in `layout`, each with its elements
    std::vector<Choice> when;              // the request is understood while all of these hold

    std::optional<bool> streams;  // switches the stream on or off
    bool sets_captured = false;
    std::vector<Choice> set;
    bool saves = false, restores = false, resets = false;
    Answer answer, otherwise;
    std::string poll;  // name of a message
    std::uint32_t delay_ms = 0;
    std::vector<Test> tests;
  };

  bool is_big = false;  // the byte order of numbers whose element states none
  std::vector<Setting> settings;
  std::vector<Request> requests;
  // The answers if no request matches: to lines, or to bytes of this form. The first form that matches is answered.
  struct Unknown {
    std::uint32_t line = 0;
    std::vector<Text> layout;  // empty: lines
    Answer answer;
    std::vector<Test> tests;  // of bytes
  };
  std::vector<Unknown> unknown;
};

}  // namespace imud
