// find_frames: finds the messages of a stream: where they begin, their constant bytes, checks, length and counters.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "protocols/frames/layout/frame_number.hpp"
#include "tools/checks/check_search.hpp"
#include "tools/find/frame_split.hpp"

namespace imud {

// A length field: a number that is the same in every frame of a length, and larger in longer frames by the
// difference of the lengths.
struct FoundLength {
  std::size_t at = 0, size = 1;  // bytes
  bool is_big = false;
  std::size_t from = 0, to = 0;  // the bytes that the number counts
  std::int64_t plus = 0;         // the number is this much larger than the count of bytes
  bool is_certain = false;       // frames of several lengths agree
};

// A number that rises by a constant step.
struct FoundCounter {
  std::size_t at = 0, size = 1;  // bytes
  bool is_big = false;
  bool is_float = false;
  double step = 1;            // of its units, from frame to frame
  std::uint64_t modulus = 0;  // at which it begins again, if below the type's range; 0: none
  double share = 0;           // share of the steps that have this size
  std::uint64_t highest = 0;  // value, of an integer
  bool is_counter() const noexcept { return !is_float && step == 1; }
};

// A number of a frame that was recognised as a physical quantity.
struct FoundField {
  std::size_t at = 0;  // byte
  FrameNumber type = {};
  std::string name = {};     // the quantity with its unit: "rate_x_deg_per_s"
  bool is_negative = false;  // the number is the quantity's negative
  std::string lsb = {};      // in the syntax of a description
  double lsb_value = 1;      // in the unit
  double offset = 0;         // in the unit
};

struct FoundMessage {
  std::size_t length = 0;
  std::vector<FrameSplit::Place> frames;  // their first bytes
  std::vector<std::byte> usual;           // of each byte, the most frequent value
  std::vector<bool> constant;             // of each byte
  std::size_t header = 0;                 // constant bytes at the beginning, by which a decoder finds a frame
  std::vector<FoundCheck> checks;         // by their places
  std::optional<FoundLength> length_field;
  std::vector<FoundCounter> counters;  // by their places
  std::vector<FoundField> fields;      // by find_fields
  std::vector<std::string> notes;      // lines for people: the evidence for these, and possible others
};

struct FoundFrames {
  std::vector<FoundMessage> messages;
  double coverage = 0;      // the share of the bytes that are in frames
  bool is_checked = false;  // each message has a check that covers nearly all varying bytes
  // The frames could also begin so many bytes later (if negative, earlier): the stream has little evidence for
  // either.
  std::vector<std::ptrdiff_t> other_begins;
};

// Returns the messages of the stream; nullopt if no frame repeats. `joint`: the byte at which a second capture
// begins; 0: there is no second capture.
std::optional<FoundFrames> find_frames(std::span<const std::byte> stream, std::size_t joint = 0);

// The rate of the most frequent messages that a clock in them suggests, if its unit is 1 s, 1 ms, 1 us or 1 ns and
// the rate a usual one; 0: no clock suggests one.
double suggested_rate(const FoundFrames& found);

// Returns the frames of a message.
std::vector<std::span<const std::byte>> frames_of(const FoundMessage& message, std::span<const std::byte> stream);

// Finds the length field of the messages.
void find_lengths(std::vector<FoundMessage>& messages);
// Finds counters and clocks in the bytes that are neither constant nor part of a check.
std::vector<FoundCounter> find_counters(const FoundMessage& message, std::span<const std::byte> stream,
                                        std::size_t joint);

}  // namespace imud
