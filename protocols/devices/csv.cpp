// The measurement CSV (protocols/measurements/measurement_csv.hpp) as a device: a header row before the first sample,
// then a row per sample. Each row is a frame and ends with LF. If the first sample has inclinometers, the table has
// their columns.
//
// The text has no checksum. A reader that joins in the middle of a number may take the rest for a whole number.
#include <span>

#include "protocols/measurements/measurement_csv.hpp"
#include "protocols/quantities/columns.hpp"
#include "protocols/wire/line_assembler.hpp"

namespace imud {
namespace {

constexpr Setting settings[] = {
    integer_setting(
        "digits", "most significant digits of a real number; 17: as few as are read as exactly the same number again",
        all_digits, 1, all_digits),
};

class CsvDevice final : public Device {
 public:
  explicit CsvDevice(const Settings& chosen) : digits_(static_cast<int>(chosen.integer("digits"))) {}

  void sample(const Sample& sample, FrameBuffer& out) noexcept override {
    if (!header_sent_) {
      with_inclination_ = sample.inclination.has_value();
      const std::string_view header =
          with_inclination_ ? measurement_csv_header_with_inclination : measurement_csv_header;
      out.append(std::as_bytes(std::span(header)));
    }
    header_sent_ = true;
    const std::span<std::byte> room = out.room(measurement_csv_row_max);
    if (room.empty()) return;
    const std::span<char, measurement_csv_row_max> row(reinterpret_cast<char*>(room.data()), room.size());
    out.push(write_measurement_csv(sample, row, with_inclination_, digits_));
  }

 private:
  const int digits_;
  bool header_sent_ = false, with_inclination_ = false;
};

class CsvDecoder final : public Decoder {
 public:
  void feed(const Frame& frame, MeasurementSink& sink) override {
    lines_.feed({reinterpret_cast<const char*>(frame.bytes.data()), frame.bytes.size()});
    while (const auto line = lines_.next()) decode(*line, sink);
  }

  // A row without its line feed may lack digits, and is therefore refused.
  void finish(MeasurementSink&) override {
    if (const std::size_t size = lines_.drop_line(); size > 0) refuse(size);
  }

 private:
  using Lines = LineAssembler<1024>;

  void decode(const Lines::Line& line, MeasurementSink& sink) {
    if (line.is_too_long()) return refuse(line.size + 1);
    const std::string_view row = trim(line.text);
    if (row.empty() || row == trim(measurement_csv_header) || row == trim(measurement_csv_header_with_inclination))
      return;
    Measurement measurement;
    if (!read_measurement_csv(row, measurement)) return refuse(line.size + 1);
    sink.on_measurement(measurement);
  }

  void refuse(std::size_t bytes) noexcept {
    ++errors_.malformed;
    errors_.skipped_bytes += bytes;
  }

  Lines lines_;
};

}  // namespace

extern constexpr Protocol csv_protocol = {
    .name = "csv",
    .summary = "rows of text, with a header row first: what imu-decode prints, with inclinometers by --inclination",
    .link = Link::bytes,
    .document = "protocols/measurements/measurement_csv.hpp",
    .settings = settings,
    .takes_inclinometers = true,
    .has_self_test = true,
    .make = make_as<Device, CsvDevice>,
    .make_decoder = [](const Settings&) -> std::unique_ptr<Decoder> { return std::make_unique<CsvDecoder>(); },
};

}  // namespace imud
