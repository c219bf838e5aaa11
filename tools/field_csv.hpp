// FieldCsv: the frames of a description as CSV, a row for each frame and a column for each of its numbers.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "protocols/frames/frame_device.hpp"
#include "tools/text_output.hpp"

namespace imud {

// The columns are `message`, `offset` (bytes of the input before the frame) and MESSAGE.FIELD for each field of each
// message, in the unit of its name. A field is empty in the rows of other messages, and where the frame leaves it
// out.
class FieldCsv {
 public:
  // Writes the header. `decoder` and `out` must outlive this.
  FieldCsv(const FrameStreamDecoder& decoder, TextOutput& out);

  void write(const DecodedFrame& frame);
  std::uint64_t rows() const noexcept { return rows_; }
  // Returns the number of rows of each message, for people: "3 imu, 1 status".
  std::string counts_text() const;

 private:
  struct Kind {
    std::string name;                               // as CSV
    std::size_t fields = 0, before = 0, after = 0;  // its columns, and other messages' columns around them
    std::uint64_t rows = 0;
  };

  const FrameStreamDecoder& decoder_;
  TextOutput& out_;
  std::vector<Kind> kinds_;
  std::vector<FieldValue> values_;
  std::string row_;
  std::uint64_t rows_ = 0;
};

}  // namespace imud
