// UlogWriter: writes measurements as a ULog, PX4's format of flight logs (docs.px4.io, "ULog File Format", version
// 1).
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "tools/arrays/row_clock.hpp"
#include "tools/arrays/row_output.hpp"
#include "tools/text_output.hpp"

namespace imud {

// Messages of each measurement, with `timestamp` in us:
// - `sensor_gyro` and `sensor_accel`, as PX4's (msg/SensorGyro.msg, SensorAccel.msg; float), if it carries these;
// - `imud_measurement`: the columns of measurement_columns() in their types, which is the measurement without loss.
// The attributes are information messages; one longer than 16 KiB is a multiple information message. The file is
// whole up to its last message if the program is killed.
class UlogWriter final : public RowOutput {
 public:
  UlogWriter(std::string path, bool with_truth, RowAttributes attributes);

  void write(const MeasurementRow& row) override;
  void flush() override;
  void finish() override;

 private:
  void write_message(char type, std::string_view content);
  void write_text(const std::string& key, std::string_view text);
  void write_definitions(std::uint64_t start_us);
  void write_sensor(char number, std::uint64_t time_us, const std::array<double, 3>& values, double temperature);

  const std::string path_;
  const bool with_truth_;
  const RowAttributes attributes_;
  TextOutput file_;
  RowClock clock_;
  bool has_begun_ = false;
  std::string content_;
};

}  // namespace imud
