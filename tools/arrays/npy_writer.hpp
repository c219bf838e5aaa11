// NpyWriter: writes measurements as a structured array that numpy.load(FILE, mmap_mode="r") maps (numpy.lib.format,
// version 1).
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "tools/arrays/row_output.hpp"
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
  std::string header() const;

  const std::string path_;
  const bool with_truth_;
  FileDescriptor file_;
  std::vector<char> held_;
  std::uint64_t rows_ = 0;  // in the file
  int error_ = 0;
};

}  // namespace imud
