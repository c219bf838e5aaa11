// FrameLayout: a message of a description, compiled into a template of its bytes and a list of the numbers in it.
// Encoder and decoder use the same list.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "protocols/frames/layout/frame_description.hpp"
#include "protocols/frames/layout/frame_element.hpp"
#include "protocols/frames/layout/frame_test_values.hpp"
#include "protocols/frames/layout/message_layout.hpp"

namespace imud {

class FrameLayout final : public MessageLayout {
 public:
  enum class Use : std::uint8_t {
    message,
    request,  // may have `_:*`, any number of bytes, if it has a length
    item,     // a part of a request; may have no constant and no check
  };
  // Throws FrameFaults with every fault of the message.
  FrameLayout(const FrameDescription& description, const FrameDescription::Message& message, Use use = Use::message);

  std::size_t size() const noexcept { return template_.size(); }  // bytes
  std::size_t longest() const noexcept override { return conditions_.empty() ? size() : whole_.bytes.size(); }
  void select(std::span<const FrameValue> values) noexcept override;
  std::size_t carries() const noexcept override { return carries_; }
  Encoded encode(const Reading& reading, const State& state, std::span<double> carried,
                 std::span<std::byte> frame) const noexcept override {
    return {size(), write(reading, state, nullptr, carried, frame)};
  }
  // Returns the number of bytes before `_:*`, or of all bytes if the layout has no `_:*`.
  std::size_t fixed() const noexcept { return variable_.value_or(size()); }
  bool is_variable() const noexcept { return variable_.has_value(); }
  // Returns a frame with the constants, the lengths, and `content` in place of `_:*`. All other bytes, the checks
  // too, are 0.
  std::vector<std::byte> with_content(std::span<const std::byte> content) const;
  // Writes the checks of a frame. Call this after some of its bytes were changed.
  void seal(std::span<std::byte> frame) const noexcept;
  // Returns true if the same bytes could begin with a frame of this layout and with a frame of the other, as far as
  // the constants tell.
  bool may_coincide(const FrameLayout& other) const noexcept;
  Found match(std::span<const std::byte> held) const noexcept override;
  bool has_check() const noexcept override { return !checks_.empty(); }
  bool reseal(std::span<std::byte> frame) const noexcept override;
  std::int64_t time_lsb_ns() const noexcept override { return clock_ ? fields_[*clock_].time_lsb_ns : 1; }
  Decoded wrapping() const noexcept override;
  std::optional<Decoded> decode(std::span<const std::byte> frame, ReadBack& read) const noexcept override;
  void read_fields(std::span<const std::byte> frame, std::span<FieldValue> values) const noexcept override;

 private:
  using Source = FrameSource::Kind;
  struct Field {
    std::size_t offset = 0;
    FrameNumber number;
    unsigned low = 0, width = 8;  // bits of the number that the field takes
    Source source = Source::constant;
    std::uint32_t status_bits = 0;  // of a bit of the status
    bool is_inverse = false;        // of a bit of the status, or a flag
    std::optional<double> limit;    // of a flag; in the unit
    const MeasuredQuantity* quantity = nullptr;
    std::optional<double> otherwise;  // FrameSource::otherwise
    // SI = (number - whole - fraction) * lsb. `whole` is separate, so that no digits are lost.
    double lsb = 1, whole = 0, fraction = 0;
    double lowest = 0, highest = 0;  // of the number
    std::int64_t time_lsb_ns = 0;    // of a clock that is an integer
    std::uint64_t period = 0;        // how many values a clock or counter has; 0: 2^64
    // With a modulus: number = (remainder of the value in the unit - bias) / scale.
    double modulus = 0, factor = 1, zero = 0, scale = 1, bias = 0;
    std::optional<std::size_t> carry;  // index in the remainders
    bool is_floor = false;             // rounded down
    bool is_inertial = false;          // a rate, specific force or increment
    std::size_t name = 0;              // index in fields()
    std::uint64_t needs = 0;           // bit of the condition under which the field is sent; 0: always
  };
  struct Check {
    FrameCheck check;
    std::size_t offset = 0;
    bool is_big = false;
    std::vector<FrameCheck::Range> ranges;
    std::vector<std::byte> extra;
    std::uint32_t line = 0;
    std::string text;
  };
  // The layout with all elements, if some are optional. select() makes the other members from this layout.
  struct Whole {
    struct Part {  // an optional element
      std::size_t offset = 0, size = 0;
      std::uint64_t needs = 0;
    };
    struct Length {
      std::size_t offset = 0;
      FrameNumber number;
      FrameCheck::Range range;
      std::size_t divisor = 1;
      std::int64_t plus = 0;
      // Returns the length that is sent for a range of so many bytes.
      std::int64_t of(std::size_t bytes) const noexcept { return static_cast<std::int64_t>(bytes / divisor) + plus; }
    };
    std::vector<std::byte> bytes, constant;
    std::vector<Field> fields;
    std::vector<Check> checks;
    std::vector<Part> parts;      // in the order of the bytes
    std::vector<Length> lengths;  // of any layout
  };
  class Compiler;

  // The places of elements in a frame whose optional elements are not known. The places are known up to the first
  // place where sizes can differ, counted from the begin of the frame, and from the last such place on, counted from
  // the end.
  struct Around {
    std::size_t first = 0, last = 0, whole = 0, frame = 0;  // of the whole layout; `frame`: bytes of the frame
    std::optional<std::size_t> operator()(std::size_t offset) const noexcept {
      if (offset <= first) return offset;
      return offset >= last ? std::optional(offset - whole + frame) : std::nullopt;
    }
  };
  Found match_variable(std::span<const std::byte> held) const noexcept;
  bool reseal_any(std::span<std::byte> frame) const noexcept;
  bool have_places(const Around& place) const noexcept;  // lengths and checks
  bool has_lengths(std::span<const std::byte> frame, const Around& place) const noexcept;
  std::uint64_t check_at(const Check& one, std::span<const std::byte> frame, const Around& place) const noexcept;
  void seal_at(std::span<const Check> checks, std::span<std::byte> frame, const Around& place) const noexcept;
  // Finds which quantities the fields carry, and which clock and which counters have the longest period.
  void find_read_back() noexcept;
  // Writes the frame. Returns the number of fields that saturate. `given`: values that replace the real
  // numbers of the Reading; nullptr: none is replaced.
  unsigned write(const Reading& reading, const State& state, const FrameTestValues* given, std::span<double> carried,
                 std::span<std::byte> frame) const noexcept;
  std::uint64_t number_of(const Field& field, const Reading& reading, const State& state,
                          const FrameTestValues* given, std::span<double> carried,
                          unsigned& saturated) const noexcept;
  std::uint64_t rounded_time(const Field& field, std::int64_t ns) const noexcept;
  // Returns the value of a field in SI. Requires a field that is neither a counter, nor a status, nor an integer
  // clock.
  static double value_of(const Field& field, std::uint64_t bits) noexcept;
  static FieldValue field_value(const Field& field, std::uint64_t bits) noexcept;
  void write_checks(std::span<std::byte> frame) const noexcept;
  static void write_check(const Check& one, std::span<std::byte> frame) noexcept;
  // Returns true if the bytes, of which there must be at most size(), agree with the constants.
  bool has_constants(std::span<const std::byte> held) const noexcept;

  std::vector<std::byte> template_;  // the constants and the unused bytes; all other bits are 0
  std::vector<std::byte> constant_;  // the bits that are constant are 1
  std::vector<Field> fields_;
  std::vector<Check> checks_;  // a check whose range contains another check follows that check
  std::byte pattern_{};        // while starting, each byte of inertial fields; 0: none
  std::size_t carries_ = 0;
  std::vector<FrameCondition> conditions_;  // of the optional elements, at most 64
  Whole whole_;
  std::optional<std::size_t> variable_;  // the place of `_:*`, which has one byte in the template
};

}  // namespace imud
