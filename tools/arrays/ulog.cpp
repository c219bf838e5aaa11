// UlogWriter: writes measurements as a ULog, PX4's format of flight logs (docs.px4.io, "ULog File Format", version
// 1).
#include <fmt/format.h>

#include <array>
#include <cstdint>
#include <cstring>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>

#include "tools/arrays/little_endian.hpp"
#include "tools/arrays/row_clock.hpp"
#include "tools/arrays/row_output.hpp"
#include "tools/text_output.hpp"

namespace imud {
namespace {

// Numbers of the messages (msg_id), each of which has one instance.
constexpr std::uint16_t measurement_id = 0, gyro_id = 1, accel_id = 2;
constexpr std::string_view message_names[] = {"imud_measurement", "sensor_gyro", "sensor_accel"};

constexpr std::string_view sensor_fields =
    "uint64_t timestamp;uint64_t timestamp_sample;uint32_t device_id;float x;float y;float z;float temperature;"
    "uint32_t error_count;uint8_t[3] clip_counter;uint8_t samples;";

std::string_view ulog_type(std::string_view type) {
  return type == "i8" ? "int64_t" : type == "u8" ? "uint64_t" : type == "u4" ? "uint32_t" : "double";
}

std::string measurement_fields(bool with_truth) {
  std::string text = "uint64_t timestamp;";
  for (const MeasurementColumn& column : measurement_columns(with_truth))
    text += column.values > 1 ? fmt::format("{}[{}] {};", ulog_type(column.type), column.values, column.name)
                              : fmt::format("{} {};", ulog_type(column.type), column.name);
  return text;
}

// Messages of each measurement, with `timestamp` in us:
// - `sensor_gyro` and `sensor_accel`, as PX4's (msg/SensorGyro.msg, SensorAccel.msg; float), if it carries these;
// - `imud_measurement`: the columns of measurement_columns() in their types, which is the measurement without loss.
// The attributes are information messages; one longer than 16 KiB is a multiple information message. The file is
// whole up to its last message if the program is killed.
class UlogWriter final : public RowOutput {
 public:
  UlogWriter(std::string path, bool with_truth, RowAttributes attributes)
      : path_(std::move(path)),
        with_truth_(with_truth),
        attributes_(std::move(attributes)),
        file_(path_),
        clock_(attributes_.rate_hz) {}

  void write(const MeasurementRow& row) override {
    const auto time_ns = clock_.next(row);
    if (!time_ns) return;
    const std::uint64_t time_us = *time_ns / 1000;
    if (!std::exchange(has_begun_, true)) write_definitions(time_us);
    if ((row.fields & Measurement::rate) != 0) write_sensor(gyro_id, time_us, row.gyro, row.temperature);
    if ((row.fields & Measurement::specific_force) != 0) write_sensor(accel_id, time_us, row.accel, row.temperature);
    content_.clear();
    append_little(content_, measurement_id, time_us);
    const char* from = reinterpret_cast<const char*>(&row);
    for (const MeasurementColumn& column : measurement_columns(with_truth_))
      for (std::size_t i = 0; i < column.values; ++i) {
        append_little(content_, from, column.size() / column.values);
        from += column.size() / column.values;
      }
    write_message('D', content_);
  }
  void flush() override { file_.flush(); }
  void finish() override {
    if (!has_begun_) write_definitions(0);
    flush();
    if (!file_.is_open()) throw std::runtime_error(fmt::format("{}: {}", path_, std::strerror(file_.error())));
    if (const std::string fault = clock_.fault(); !fault.empty())
      throw std::runtime_error(fmt::format("{}: {}", path_, fault));
  }

 private:
  void write_message(char type, std::string_view content) {
    std::string header;
    append_little(header, static_cast<std::uint16_t>(content.size()));
    header += type;
    file_.write(header);
    file_.write(content);
  }
  void write_text(const std::string& key, std::string_view text) {
    constexpr std::size_t longest = 16 * 1024;
    const bool is_multiple = text.size() > longest;
    for (std::size_t begin = 0; begin == 0 || begin < text.size(); begin += longest) {
      const std::string_view part = text.substr(begin, longest);
      const std::string typed_key = fmt::format("char[{}] {}", part.size(), key);
      std::string content;
      if (is_multiple) content += begin > 0 ? '\1' : '\0';  // continues the part before
      content += static_cast<char>(typed_key.size());
      content.append(typed_key).append(part);
      write_message(is_multiple ? 'M' : 'I', content);
    }
  }
  void write_definitions(std::uint64_t start_us) {
    std::string header("ULog\x01\x12\x35\x01", 8);
    append_little(header, start_us);
    file_.write(header);
    write_message('B', std::string(40, '\0'));  // no flag is set, no data are appended
    write_text("sys_name", "imud");
    for (const auto& [key, text] : attributes_.texts) write_text(key, text);
    if (attributes_.seed) {
      std::string content = "\x0Duint64_t seed";
      append_little(content, *attributes_.seed);
      write_message('I', content);
    }
    for (const std::string_view name : message_names)
      write_message(
          'F', fmt::format("{}:{}", name,
                           name == message_names[0] ? measurement_fields(with_truth_) : std::string(sensor_fields)));
    for (std::size_t i = 0; i < std::size(message_names); ++i) {
      std::string content(1, '\0');  // the only instance
      append_little(content, static_cast<std::uint16_t>(i));
      write_message('A', content.append(message_names[i]));
    }
  }
  void write_sensor(std::uint16_t number, std::uint64_t time_us, const std::array<double, 3>& values,
                    double temperature) {
    content_.clear();
    append_little(content_, number, time_us, time_us, std::uint32_t{0});
    for (const double value : values) append_little(content_, static_cast<float>(value));
    append_little(content_, static_cast<float>(temperature), std::uint32_t{0});
    content_.append(3, '\0');
    content_ += '\1';
    write_message('D', content_);
  }

  const std::string path_;
  const bool with_truth_;
  const RowAttributes attributes_;
  TextOutput file_;
  RowClock clock_;
  bool has_begun_ = false;
  std::string content_;
};

}  // namespace

extern constexpr RowFormat ulog_row_format = {
    .name = "ulog",
    .help = "also writes a ULog, PX4's format of logs: sensor_gyro, sensor_accel, and all as imud_measurement",
    .keeps_attributes = true,
    .needs_time = true,
    .make = make_writer<UlogWriter>};

}  // namespace imud
