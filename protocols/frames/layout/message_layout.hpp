// MessageLayout: encodes and decodes one message of a description. FrameLayout is for messages with numbers at
// fixed places, TextLayout for lines of text.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "protocols/frames/layout/frame_fields.hpp"
#include "protocols/frames/layout/frame_settings.hpp"
#include "protocols/measurements/measured_quantities.hpp"

namespace imud {

// No function but the constructors and the destructor throws or allocates.
class MessageLayout {
 public:
  virtual ~MessageLayout() = default;

  virtual std::size_t longest() const noexcept = 0;  // bytes of the longest frame
  // Chooses the optional elements that frames have with these values of all settings. Before the first call, frames
  // are as delivered. All other functions depend on this choice, except longest(), fields() and rows(), which include
  // all elements.
  virtual void select(std::span<const FrameValue> values) noexcept { static_cast<void>(values); }
  // Returns true if the message, or an element that is not selected, depends on the increments of the Reading.
  bool has_increments() const noexcept { return has_increments_; }
  // Returns true if the message carries the sensor's clock.
  bool has_time() const noexcept { return has_time_; }
  // Returns the number of fields whose remainder is carried, in all elements.
  virtual std::size_t carries() const noexcept = 0;
  // The components that the message carries, as in ReadBack.
  std::uint32_t components() const noexcept { return components_; }

  // The state of the device that a frame shows beside the sample.
  struct State {
    std::uint64_t count = 0;   // messages of this kind that were sent before
    std::uint64_t frames = 0;  // messages of any kind that were sent before
    bool is_starting = false;  // FrameDescription::Start::until has not passed since power on
  };
  struct Encoded {
    std::size_t size = 0;    // bytes of the frame
    unsigned saturated = 0;  // fields that saturate by more than half an LSB
  };
  // Writes a message to the begin of `frame`, which must have longest() bytes. `carried`: the remainders of the
  // message, carries() numbers, 0 at first. Values saturate, and are rounded to nearest, a half away from zero.
  // Clocks, counters and status are sent with their low bits.
  virtual Encoded encode(const Reading& reading, const State& state, std::span<double> carried,
                         std::span<std::byte> frame) const noexcept = 0;

  enum class Match : std::uint8_t { no, unfinished, wrong_check, yes };
  struct Found {
    Match match = Match::no;
    std::size_t size = 0;  // bytes of the frame, if it matches
  };
  // Compares the begin of `held` with the constants, and the checks of a whole frame. Requires a `held` that is not
  // empty.
  virtual Found match(std::span<const std::byte> held) const noexcept = 0;

  // Returns true if the frames of the message have a check.
  virtual bool has_check() const noexcept = 0;
  // Writes the checks of a whole frame, with any optional elements. Returns false, and writes nothing, if the message
  // has no check, or if the other bytes are no frame of the message.
  virtual bool reseal(std::span<std::byte> frame) const noexcept = 0;

  // The number of a clock or a counter in a frame. `period`: the number of values after which it wraps; 0: 2^64.
  struct Wrapping {
    std::uint64_t value = 0, period = 0;
  };
  struct Decoded {
    std::optional<Wrapping> time, counter, alive_counter, frame_counter;
  };
  // The LSB of Decoded::time, ns; 1 if the message has none.
  virtual std::int64_t time_lsb_ns() const noexcept = 0;
  // The clock and the counters that decode() returns, with values of 0.
  virtual Decoded wrapping() const noexcept = 0;
  // Reads the quantities of a frame that matches into `read`. Returns nullopt if a number is not finite.
  virtual std::optional<Decoded> decode(std::span<const std::byte> frame, ReadBack& read) const noexcept = 0;

  // The names of a frame's numbers, with their units, in the order of the frame. A name may occur more than once.
  const std::vector<std::string>& fields() const noexcept { return field_names_; }
  // Reads the numbers of fields() from a frame. Requires a frame that decode() has accepted, and one element of
  // `values` for each name.
  virtual void read_fields(std::span<const std::byte> frame, std::span<FieldValue> values) const noexcept = 0;

  // A line of the layout, for people.
  struct Row {
    std::optional<std::size_t> offset;  // bytes; nullopt if it depends on elements of variable length
    std::size_t size = 0;               // bytes; 0 if it varies
    std::string type, lsb, unit, name;
    std::string remark = {};  // of a number, after its name
  };
  const std::vector<Row>& rows() const noexcept { return rows_; }

 protected:
  MessageLayout() = default;
  MessageLayout(const MessageLayout&) = default;
  MessageLayout& operator=(const MessageLayout&) = default;

  bool has_increments_ = false, has_time_ = false;
  std::uint32_t components_ = 0;
  // Indices of the fields that are read back as clock and counters. Among several, the field with the longest period.
  std::optional<std::size_t> clock_, counter_, alive_counter_, frame_counter_;
  std::vector<std::string> field_names_;
  std::vector<Row> rows_;
};

// The significant decimal digits of a product of an integer and an LSB. Further digits are rounding errors.
inline constexpr int certain_digits = 15;
// Return the value of a field. `is_negated`: undoes the minus of the description. `modulus`: the value remains
// between 0 and the modulus; 0: there is no modulus.
FieldValue real_field(double value, bool is_negated, double modulus, int digits = certain_digits) noexcept;
FieldValue integer_field(std::uint64_t magnitude, bool is_negative = false) noexcept;

// Returns true if one of these bits of the status, or FrameSource::starting, is set.
bool is_set(std::uint32_t bits, const Reading& reading, const MessageLayout::State& state) noexcept;

}  // namespace imud
