// read_npy: reads an array that NumPy has saved (numpy.save; the format is numpy.lib.format, versions 1 to 3).
#pragma once

#include <cstddef>
#include <istream>
#include <vector>

namespace imud {

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
