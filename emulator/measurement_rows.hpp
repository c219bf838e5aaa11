// Measurements as rows of arrays of NumPy: what a product has sent, decoded, and the truth beside it.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "emulator/config.hpp"
#include "protocols/protocol.hpp"
#include "transports/file_descriptor.hpp"
#include "transports/port.hpp"

namespace imud {

// The row of imu-decode's array (tools/README.md), without padding. A quantity that the measurement does not carry is
// NaN, NaT (`time_ns`) or the greatest value (`counter`).
struct MeasuredRow {
  std::int64_t time_ns;
  std::uint64_t counter;
  std::array<double, 3> gyro, accel, dtheta, dvel;
  double temperature;
  std::uint32_t status, fields;
};
MeasuredRow measured_row(const Measurement& measurement, unsigned absent_rates) noexcept;

// The truth at a measurement, without errors. The increments are those since the measurement before.
struct TrueRow {
  std::int64_t time_ns;  // of the sample, by the sensor's own clock
  std::array<double, 3> gyro, accel, dtheta, dvel;
};

inline constexpr std::string_view measured_row_type =
    "('time_ns', '<i8'), ('counter', '<u8'), ('gyro', '<f8', (3,)), ('accel', '<f8', (3,)), ('dtheta', '<f8', (3,)), "
    "('dvel', '<f8', (3,)), ('temperature', '<f8'), ('status', '<u4'), ('fields', '<u4')";
inline constexpr std::string_view true_row_type =
    "('time_ns', '<i8'), ('true_gyro', '<f8', (3,)), ('true_accel', '<f8', (3,)), ('true_dtheta', '<f8', (3,)), "
    "('true_dvel', '<f8', (3,))";

// A file with an array, whose rows are written in any order, also by processes that have inherited it. Everything
// throws std::runtime_error, which names the file and the cause; the constructor OpenError.
class ArrayFile {
 public:
  ArrayFile(std::string path, std::string_view row_type);
  // Sets the shape: the file has that many rows then, of zeros where none is written.
  void set_shape(std::span<const std::uint64_t> shape, std::size_t row_size);
  // Writes bytes at an offset from the first row.
  void write(std::span<const std::byte> bytes, std::uint64_t offset) const;

 private:
  std::string header(std::span<const std::uint64_t> shape) const;
  void write_at(std::span<const std::byte> bytes, std::uint64_t offset) const;

  const std::string path_, row_type_;
  FileDescriptor file_;
};

// A port that decodes what a device sends, and calls `receive` for each measurement, within send().
std::unique_ptr<Port> decoding_port(const ImuConfig& imu, std::function<void(const Measurement&)> receive);
// A port that sends nothing.
std::unique_ptr<Port> idle_port();

// Returns an imu that samples the same truth at the same instants, place and axes, without errors, and sends it bit
// for bit (`native`).
ImuConfig without_errors(const ImuConfig& imu);

}  // namespace imud
