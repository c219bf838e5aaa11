// FrameRequests: the requests that a unit understands, and its answers, compiled from a description.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "protocols/frames/host/frame_captures.hpp"

namespace imud {

// The state of the unit that answers.
struct FrameAnswering {
  const FrameSettings& settings;
  std::span<const FrameValue> values;  // of all settings
  Reading newest;
};

// An answer: either text with {setting}, {value}, {NAME}, {any} and {line}, or elements, or nothing.
class FrameAnswer {
 public:
  FrameAnswer() = default;
  // `is_refusal`: {value} is the text that the host has sent; otherwise it is the present value of the setting.
  // `place`: text for faults. Throws FrameFaults.
  FrameAnswer(const FrameDescription& description, const FrameHostDescription::Answer& answer,
              const std::string& place, const FrameLine* request, std::size_t request_size, bool is_refusal,
              const FrameSettings& settings);

  bool is_given() const noexcept { return !parts_.empty() || bytes_; }
  bool has_quantities() const noexcept { return bytes_ && bytes_->has_quantities(); }
  std::size_t longest() const noexcept { return longest_; }  // bytes
  // Writes the answer to `out`, and returns its size. Requires at least longest() bytes in `out`.
  std::size_t write(const FrameCaptures& captures, const FrameAnswering& with,
                    std::span<std::byte> out) const noexcept;

 private:
  enum class Kind : std::uint8_t { text, setting, value, named, any, line };
  struct Part {
    Kind kind = Kind::text;
    std::string text;
    std::size_t setting = 0;  // of `named`
  };
  void add_parts(std::string_view text, const FrameLine* request, const FrameSettings& settings);
  std::string_view text_of(const Part& part, const FrameCaptures& captures, const FrameAnswering& with,
                           FrameSettings::Room& room) const noexcept;

  std::vector<Part> parts_;
  std::optional<FrameBytes> bytes_;
  bool is_refusal_ = false;
  std::size_t longest_ = 0;
};

struct FrameRequest {
  std::uint32_t line = 0;  // in the file
  std::string title;       // the line or the elements, for people
  // One of the two.
  std::optional<FrameLine> text;
  std::optional<FrameBytes> bytes;
  std::vector<FrameCondition> when;  // all must hold
  // The effects, in this order.
  std::vector<FrameChosen> set;
  bool sets_captured = false;
  bool saves = false, restores = false;
  std::optional<bool> streams;
  Nanoseconds delay{};  // before the effects below
  FrameAnswer answer;
  std::optional<std::size_t> poll;  // index of a message
  bool resets = false;
  FrameAnswer otherwise;  // the only effect if a captured value is not allowed

  // Returns true if the unit understands a request of this form with these captures.
  bool accepts(const FrameCaptures& captures) const noexcept { return captures.is_allowed || otherwise.is_given(); }
};

// An answer if no request matches: to lines, or to bytes of this form.
struct FrameUnknown {
  std::optional<FrameBytes> form;
  FrameAnswer answer;
};

// Immutable. Only the constructor and the functions for people throw or allocate.
class FrameRequests {
 public:
  // Throws FrameFaults with every fault.
  explicit FrameRequests(const FrameDescription& description);

  const FrameSettings& settings() const noexcept { return settings_; }
  std::span<const FrameRequest> all() const noexcept { return all_; }
  bool has_lines() const noexcept { return has_lines_; }
  // Returns true if an answer has quantities of the newest sample.
  bool needs_samples() const noexcept { return needs_samples_; }
  std::size_t longest_answer() const noexcept { return longest_answer_; }  // bytes
  std::span<const FrameUnknown> unknown() const noexcept { return unknown_; }
  const std::vector<FrameValue>& delivered() const { return delivered_; }  // values of all settings
  std::optional<std::size_t> baud_setting() const noexcept { return baud_setting_; }

  // Returns an example of each request, lines with their end, with the settings as delivered.
  std::vector<std::vector<std::byte>> examples() const;

 private:
  void add(const FrameDescription& description, const FrameHostDescription::Request& described);
  void add_unknown(const FrameDescription& description, const FrameHostDescription::Unknown& described);
  void add_effects(const FrameDescription& description, const FrameHostDescription::Request& described,
                   FrameRequest& request);
  void check_overlaps();
  std::string overlap(std::size_t first, std::size_t second, std::span<const std::vector<std::string>> lines) const;
  template <class Act>
  void attempt(std::uint32_t line, const std::string& place, Act act);

  FrameSettings settings_;
  std::vector<FrameRequest> all_;
  std::vector<FrameUnknown> unknown_;
  std::vector<FrameValue> delivered_;
  std::optional<std::size_t> baud_setting_;
  std::size_t longest_answer_ = 0;
  bool has_lines_ = false, needs_samples_ = false;
  std::vector<FrameFault> faults_;
};

// Returns tables of the settings and the requests, as lines for people.
std::vector<std::string> frame_request_rows(const FrameDescription& description);

// Sends each test request of a description to a unit as delivered, and compares the answer. Throws FrameFaults with
// every difference.
void test_frame_requests(const FrameDescription& description);

}  // namespace imud
