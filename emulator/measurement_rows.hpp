// Measurements as rows of arrays of NumPy: what a product has sent, decoded, and the truth beside it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>

#include "emulator/config.hpp"
#include "protocols/measurement_row.hpp"
#include "protocols/protocol.hpp"
#include "transports/file_descriptor.hpp"
#include "transports/port.hpp"

namespace imud {

// The truth at a measurement, without errors, by truth_columns(). The increments are those since the measurement
// before.
struct TrueRow {
  std::int64_t time_ns;  // of the sample, by the sensor's own clock
  TrueValues values;
};

// A file with an array, whose rows are written in any order, also by processes that have inherited it.
class ArrayFile {
 public:
  // Throws OpenError, which names the file and the cause.
  ArrayFile(std::string path, std::span<const MeasurementColumn> columns);
  // Sets the shape: the file has that many rows then, of zeros where none is written.
  void set_shape(std::span<const std::uint64_t> shape, std::size_t row_size) noexcept;
  // Writes bytes at an offset from the first row. After an error, such as a full disk, nothing is written any more.
  void write(std::span<const std::byte> bytes, std::uint64_t offset) noexcept;
  // Throws std::runtime_error, which names the file and the cause, if this process could not write all of it.
  void check() const;

 private:
  void write_at(std::span<const std::byte> bytes, std::uint64_t offset) noexcept;

  const std::string path_;
  const std::span<const MeasurementColumn> columns_;
  FileDescriptor file_;
  int error_ = 0;
};

// A port that decodes what a device sends, and calls `receive`, which must not throw, for each measurement, within
// send().
std::unique_ptr<Port> decoding_port(const ImuConfig& imu, std::function<void(const Measurement&)> receive);
// A port that sends nothing.
std::unique_ptr<Port> idle_port();

// Returns an imu that samples the same truth at the same instants, place and axes, without errors, and sends it bit
// for bit (`native`).
ImuConfig without_errors(const ImuConfig& imu);

}  // namespace imud
