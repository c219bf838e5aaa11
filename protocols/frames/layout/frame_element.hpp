// FrameElement: one element of a frame's layout, parsed from its text (README.md).
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "protocols/frames/layout/frame_check.hpp"
#include "protocols/frames/layout/frame_description.hpp"
#include "protocols/frames/layout/frame_number.hpp"
#include "protocols/measurements/measured_quantities.hpp"

namespace imud {

// The origin of a number.
struct FrameSource {
  enum class Kind : std::uint8_t {
    constant,
    quantity,       // in `in`
    alive_counter,  // counts the message
    frame_counter,  // counts all messages of the device
    status,         // 1 if one of `bits` is set: in Sample::status, or `starting`
    flag,           // 1 if the quantity in `in` is above 0 or, if there is a `limit`, below the limit
  };
  static constexpr std::uint32_t starting = 1U << 31;  // of `bits`: the state of the device, no bit of Sample::status

  Kind kind = Kind::constant;
  MeasuredIn in = {};
  std::string name = {};    // as written, with its unit: "rate_x_deg_per_s"; without sign, modulus and inverse
  std::string unit = {};    // as written, for people: "deg_per_s"
  std::uint32_t bits = 0;   // of a status
  bool is_inverse = false;  // of a status or a flag
  std::optional<double> limit = {};  // of a flag; in the unit
  std::uint64_t constant = 0;        // of a constant
  double modulus = 0;                // in the unit; 0: none
  // SI; the value of a quantity or flag if the unit has no navigation solution of its own.
  std::optional<double> otherwise = {};
};

struct FrameElement {
  enum class Kind : std::uint8_t { constant, label, unused, padding, field, bits, length, check };
  struct BitField {
    unsigned low = 0, high = 0;  // numbers of bits, 0 the lowest
    FrameSource source;
  };
  // The bytes from the label `from` to the label `to`. An empty `to` is the end of the frame or, for a check without
  // is_to_end, the place of the check.
  struct Range {
    std::string from, to;
    bool is_to_end = false;  // `@` alone
  };

  Kind kind = Kind::constant;
  std::string text;       // as in the file, without the condition
  std::string condition;  // of an optional element, such as "MASK.3"; empty: it is always sent
  // A constant: its bytes. Unused bytes: the bytes that are sent; empty: zeros. A check: the bytes that follow its
  // ranges.
  std::vector<std::byte> bytes;
  std::string label;           // without the @
  bool is_variable = false;    // any number of unused bytes; `count` is then 1
  std::size_t count = 0;       // of unused bytes; of padding: the size of the frame becomes a multiple of this
  FrameNumber number;          // of a field, bits, a length and a check
  FrameSource source;          // of a field
  double lsb = 1, offset = 0;  // of a field, in its unit
  bool has_carry = false;      // of a field
  bool is_floor = false;       // of a field: rounded down
  std::vector<BitField> bit_fields;
  std::vector<Range> ranges;  // of a length (one) and of a check
  std::size_t divisor = 1;    // of a length, which counts pieces of so many bytes
  std::int64_t plus = 0;      // of a length
  std::optional<FrameCheck> check;
};

// Throws std::invalid_argument.
[[noreturn]] void refuse_element(const std::string& fault);

// Returns the element. `is_big`: the byte order of numbers whose element states none. Throws std::invalid_argument
// with the fault and the remedy.
FrameElement parse_frame_element(std::string_view text, bool is_big, std::span<const FrameDescription::Check> own);

// Returns the source with this name, as in bit fields and test values: a quantity with its unit, a counter, or a bit
// of the status. Returns nullopt if there is none.
std::optional<FrameSource> find_frame_source(std::string_view name);
// Returns the fault that a name is unknown, with the nearest known name.
std::string unknown_frame_source(std::string_view name);

}  // namespace imud
