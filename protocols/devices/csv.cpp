// The measurement CSV (protocols/measurement_csv.hpp) as a device: the header row before the first sample, then a row
// per sample, each in its own frame, LF at the end.
//
// Text has no checksum: a reader that joins within a row may take the rest of its first number for a whole one.
#include <array>
#include <cstring>
#include <utility>

#include "protocols/columns.hpp"
#include "protocols/measurement_csv.hpp"

namespace imud {

namespace {

class CsvDevice final : public Device {
 public:
  void sample(const Sample& sample, FrameBuffer& out) noexcept override {
    if (!header_sent_) push(measurement_csv_header, out);
    header_sent_ = true;
    std::array<char, measurement_csv_row_max> row;
    push({row.data(), write_measurement_csv({sample, Measurement::all}, row)}, out);
  }

 private:
  static void push(std::string_view text, FrameBuffer& out) noexcept {
    const std::span<std::byte> room = out.room(text.size());
    if (room.empty()) return;
    std::memcpy(room.data(), text.data(), text.size());
    out.push(text.size());
  }

  bool header_sent_ = false;
};

class CsvDecoder final : public Decoder {
 public:
  void feed(const Frame& frame, MeasurementSink& sink) override {
    std::string_view rest(reinterpret_cast<const char*>(frame.bytes.data()), frame.bytes.size());
    while (!rest.empty()) {
      const std::size_t end = rest.find('\n');
      hold(rest.substr(0, end));
      if (end == std::string_view::npos) return;
      rest.remove_prefix(end + 1);
      line(sink);
    }
  }

  // A row without its end may lack digits, too.
  void finish(MeasurementSink&) override {
    if (length_ > 0) refuse(length_);
    length_ = 0;
  }

 private:
  static constexpr std::size_t line_max = 1024;

  // Of a line that is too long, only the length is kept.
  void hold(std::string_view part) noexcept {
    if (length_ + part.size() <= line_max) std::memcpy(line_.data() + length_, part.data(), part.size());
    length_ += part.size();
  }

  void line(MeasurementSink& sink) {
    const std::size_t length = std::exchange(length_, 0);
    if (length > line_max) return refuse(length + 1);
    const std::string_view row = trim({line_.data(), length});
    if (row.empty() || row == trim(measurement_csv_header)) return;
    Measurement measurement;
    if (!read_measurement_csv(row, measurement)) return refuse(length + 1);
    sink.on_measurement(measurement);
  }

  void refuse(std::size_t bytes) noexcept {
    ++errors_.malformed;
    errors_.skipped_bytes += bytes;
  }

  std::array<char, line_max> line_;
  std::size_t length_ = 0;  // of the line so far, even where it exceeds the room for it
};

}  // namespace

extern const Protocol csv_protocol;
constexpr Protocol csv_protocol = {
    .name = "csv",
    .summary = "rows of text, with a header row first: what imu-decode prints",
    .link = Link::bytes,
    .document = "protocols/measurement_csv.hpp",
    .settings = {},
    .make = [](const Settings&) -> std::unique_ptr<Device> { return std::make_unique<CsvDevice>(); },
    .make_decoder = [](const Settings&) -> std::unique_ptr<Decoder> { return std::make_unique<CsvDecoder>(); },
};

}  // namespace imud
