// NpyFile: arrays of NumPy (numpy.lib.format), written in version 1, read in versions 1 to 3 as of numpy.save.
#pragma once

#include <cstddef>
#include <cstdint>
#include <istream>
#include <span>
#include <string>
#include <vector>

#include "protocols/measurements/measurement_row.hpp"

namespace imud {

// Returns the header of an array with these columns and this shape: a text of a length that depends neither on the
// number of rows nor on the number of dimensions up to two.
std::string npy_header(std::span<const MeasurementColumn> columns, std::span<const std::uint64_t> shape);

struct NpyArray {
  std::size_t rows = 0;
  std::size_t columns = 0;     // 1 for an array of one dimension
  std::vector<double> values;  // row by row
  double at(std::size_t row, std::size_t column) const { return values[row * columns + column]; }
};

// Reads an array of float64 in C order with one or two dimensions, little- or big-endian, to the end of the stream.
// Throws std::runtime_error, with the fault and the remedy, for any other content. Memory is allocated only
// for data that are there.
NpyArray read_npy(std::istream& in);

}  // namespace imud
