// FieldRecording: the frames of a decoder, with their fields.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "protocols/frames/layout/frame_fields.hpp"
#include "tests/protocols/frames/frame_unit.hpp"

namespace imud {

inline double number_of(const FieldValue& value) {
  if (value.kind == FieldValue::Kind::real) return value.real;
  const auto magnitude = static_cast<double>(value.magnitude);
  return value.is_negative ? -magnitude : magnitude;
}

class FieldRecording final : public FrameReceiver {
 public:
  struct Row {
    std::string message;
    std::uint64_t offset = 0;
    std::map<std::string, FieldValue> fields;
  };
  explicit FieldRecording(Decoder& decoder) : decoder_(dynamic_cast<FrameStreamDecoder&>(decoder)) {
    decoder_.pass_frames_to(this);
  }
  ~FieldRecording() { decoder_.pass_frames_to(nullptr); }
  FieldRecording(const FieldRecording&) = delete;
  FieldRecording& operator=(const FieldRecording&) = delete;

  void on_frame(const DecodedFrame& frame) override {
    const FrameKind& kind = decoder_.frame_kinds()[frame.kind];
    std::vector<FieldValue> values(kind.fields.size());
    decoder_.read_fields(frame, values);
    Row& row = rows.emplace_back(Row{kind.name, frame.offset, {}});
    for (std::size_t i = 0; i < values.size(); ++i) row.fields.emplace(kind.fields[i], values[i]);
  }

  std::vector<Row> rows;

 private:
  FrameStreamDecoder& decoder_;
};

}  // namespace imud
