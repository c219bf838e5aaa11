// NpyFile: NumPy array files (numpy.lib.format), written in version 1, and read in versions 1 to 3, as numpy.save
// writes them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <istream>
#include <span>
#include <string>
#include <vector>

#include "protocols/measurements/measurement_row.hpp"

namespace imud {

// Returns the file header of an array with these columns and this shape. The length of the header depends neither
// on the number of rows nor, up to two dimensions, on the number of dimensions.
std::string npy_header(std::span<const MeasurementColumn> columns, std::span<const std::uint64_t> shape);

// Reads an array of float64 in C order with one or two dimensions, little- or big-endian, row by row to the end of
// the stream. The constructor reads the header. Constructor and next() throw std::runtime_error, with the fault
// and the remedy, for any other content.
class NpyRows {
 public:
  explicit NpyRows(std::istream& in);
  std::size_t rows() const noexcept { return rows_; }
  std::size_t columns() const noexcept { return columns_; }  // 1 for an array of one dimension
  // Returns the next row, which is valid until the next call; empty after the last one.
  std::span<const double> next();

 private:
  std::istream& in_;
  std::size_t rows_ = 0, columns_ = 0;
  bool is_little_ = true;
  std::size_t read_ = 0;       // rows
  std::vector<double> block_;  // rows read ahead
  std::size_t taken_ = 0;      // values of the block
};

}  // namespace imud
