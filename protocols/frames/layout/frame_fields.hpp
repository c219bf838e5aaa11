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
  std::size_t kind = 0;      // index in FrameStreamDecoder::frame_kinds()
  std::uint64_t offset = 0;  // bytes of the input before the frame; SLIP, HDLC: before the byte after the mark
  std::span<const std::byte> bytes;  // without the escapes of its framing
};

class FrameReceiver {
 public:
  virtual void on_frame(const DecodedFrame& frame) = 0;

 protected:
  ~FrameReceiver() = default;
};

}  // namespace imud
