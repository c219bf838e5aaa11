// MatWriter: writes measurements as a MATLAB level 5 MAT-file, by libmatio.
#pragma once

#include <string>
#include <vector>

#include "tools/arrays/row_output.hpp"

namespace imud {

// The variables are as in measurement_columns(), n x 1 or n x 3, in the types of these columns, and a struct `imud`
// with the attributes and, by column, `unit`, `frame` and `meaning`. A variable of level 5 states its size at its
// begin, so that all rows are kept in memory (row_size() bytes each) until finish() writes the file; at most 2 GiB a
// variable, which are 89 million rows.
class MatWriter final : public RowOutput {
 public:
  MatWriter(std::string path, bool with_truth, RowAttributes attributes);

  void write(const MeasurementRow& row) override;
  void flush() override {}
  void finish() override;

 private:
  const std::string path_;
  const bool with_truth_;
  const RowAttributes attributes_;
  // By column and axis: MATLAB keeps the values of an axis together.
  std::vector<std::vector<std::vector<char>>> held_;
  std::size_t rows_ = 0;
  bool is_full_ = false;
};

}  // namespace imud
