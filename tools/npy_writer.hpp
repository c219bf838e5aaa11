// NpyWriter: writes measurements as a structured array that numpy.load(FILE, mmap_mode="r") maps (numpy.lib.format,
// version 1).
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "tools/measurement_row.hpp"
#include "transports/file_descriptor.hpp"

namespace imud {

// Keeps at most 64 KiB of rows. The header has room for any number of rows. The rows are written before their number,
// so that the file is a whole array at any time, also if the program is killed.
class NpyWriter final : public RowOutput {
 public:
  NpyWriter(std::string path, bool with_truth);

  void write(const MeasurementRow& row) override;
  void flush() override;
  void finish() override;

 private:
  void write_at(const char* bytes, std::size_t size, std::uint64_t offset);
  std::string header() const;

  const std::string path_;
  const bool with_truth_;
  FileDescriptor file_;
  std::vector<char> held_;
  std::uint64_t rows_ = 0;  // in the file
  int error_ = 0;
};

// Returns the header of an array of the shape: a text of a length that depends neither on the number of rows nor on
// the number of dimensions up to two.
std::string npy_header(std::span<const MeasurementColumn> columns, std::span<const std::uint64_t> shape);

}  // namespace imud
