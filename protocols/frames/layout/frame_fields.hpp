// The numbers of decoded frames, by the names that a description gives them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace imud {

// The number in a field of a frame, converted to the unit of the field's name: LSB, offset and a minus of the
// description are undone.
struct FieldValue {
  enum class Kind : std::uint8_t {
    left_out,  // the frame has no number there
    integer,   // `magnitude` and its sign, exactly
    real,      // `real`, of which `digits` significant decimal digits count
  };
  Kind kind = Kind::left_out;
  bool is_negative = false;
  std::uint64_t magnitude = 0;
  double real = 0;
  int digits = 0;
};

// A message of a description.
struct FrameKind {
  std::string name;                 // unique among all kinds
  std::vector<std::string> fields;  // names with their units, such as "rate_x_deg_per_s"; all differ
};

// A frame of one of the kinds. It is valid during the call that passes it.
struct DecodedFrame {
  std::size_t kind = 0;      // index in FieldDecoder::frame_kinds()
  std::uint64_t offset = 0;  // bytes of the input before the frame; SLIP, HDLC: before the byte after the mark
  std::span<const std::byte> bytes;  // without the escapes of its framing
};

class FrameReceiver {
 public:
  virtual void on_frame(const DecodedFrame& frame) = 0;

 protected:
  ~FrameReceiver() = default;
};

// The second base class of a Decoder whose frames have named fields.
class FieldDecoder {
 public:
  virtual std::span<const FrameKind> frame_kinds() const noexcept = 0;
  // Passes each frame that is decoded from now on to `receiver`, even if other frames of the same sample are
  // missing; nullptr: passes no frames. Requires that `receiver` exists as long as the decoder is called.
  virtual void pass_frames_to(FrameReceiver* receiver) noexcept = 0;
  // Reads the fields of a frame during FrameReceiver::on_frame(). `values`: one element for each name of the
  // frame's kind.
  virtual void read_fields(const DecodedFrame& frame, std::span<FieldValue> values) const noexcept = 0;

 protected:
  ~FieldDecoder() = default;
};

}  // namespace imud
