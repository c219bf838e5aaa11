// Hdf5Writer: writes measurements as an HDF5 file with a dataset for each quantity.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "tools/arrays/row_output.hpp"

namespace imud {

// The datasets are as in measurement_columns(), n or n x 3, chunked and extensible, with the attributes
// `unit`, `frame` and `meaning`. Keeps at most 4096 rows. After flush() the file is whole. Between flushes, a killed
// program may leave a broken file.
class Hdf5Writer final : public RowOutput {
 public:
  Hdf5Writer(std::string path, bool with_truth, const RowAttributes& attributes);
  ~Hdf5Writer() override;

  void write(const MeasurementRow& row) override;
  void flush() override;
  void finish() override;

 private:
  struct File;
  void write_rows();

  const std::string path_;
  const bool with_truth_;
  std::unique_ptr<File> file_;
  std::vector<std::vector<char>> held_;  // by column
  std::size_t rows_held_ = 0;
  std::uint64_t rows_ = 0;  // in the file
  bool has_failed_ = false;
};

}  // namespace imud
