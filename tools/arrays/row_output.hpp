// RowOutput: a file of measurements as rows.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "protocols/measurements/measurement_row.hpp"

namespace imud {

// A file of rows. The constructor opens it, and throws std::runtime_error, which names the file and the cause.
class RowOutput {
 public:
  virtual ~RowOutput() = default;
  virtual void write(const MeasurementRow& row) = 0;
  // Writes all rows to the file, which is then complete. Does nothing for a format that cannot grow.
  virtual void flush() = 0;
  // Ends the file. Throws std::runtime_error, which names the file and the cause, if the end or an earlier row
  // could not be written.
  virtual void finish() = 0;
};

// Attributes of the file that a writer gets beside the rows.
struct RowAttributes {
  std::vector<std::pair<std::string, std::string>> texts;  // by name; UTF-8
  std::optional<std::uint64_t> seed;
  std::string imu = "imu";             // the name of the imu; UTF-8
  std::optional<double> rate_hz = {};  // of measurements without time
};

// A format of files of rows. The last lines of STEM.cpp here are the entry STEM_row_format, named "STEM".
struct RowFormat {
  std::string_view name;
  std::string_view help;  // of its option --NAME
  bool keeps_attributes, needs_time;
  std::unique_ptr<RowOutput> (*make)(std::string path, bool with_truth, const RowAttributes& attributes);
};

std::span<const RowFormat* const> row_formats() noexcept;
// Returns the format of that name; nullptr if there is none.
const RowFormat* find_row_format(std::string_view name) noexcept;

// Implements RowFormat::make for a writer, whose constructor need not take attributes.
template <typename Writer>
std::unique_ptr<RowOutput> make_writer(std::string path, bool with_truth, const RowAttributes& attributes) {
  if constexpr (std::is_constructible_v<Writer, std::string, bool, const RowAttributes&>)
    return std::make_unique<Writer>(std::move(path), with_truth, attributes);
  else
    return std::make_unique<Writer>(std::move(path), with_truth);
}

}  // namespace imud
