// RowOutput: a file of measurements as rows of an array.
#pragma once

#include "protocols/measurement_row.hpp"

namespace imud {

// A file of rows. The constructor opens it, and throws std::runtime_error, which names the file and the cause.
class RowOutput {
 public:
  virtual ~RowOutput() = default;
  virtual void write(const MeasurementRow& row) = 0;
  // Brings all rows into the file, which is whole then.
  virtual void flush() = 0;
  // Ends the file. Throws std::runtime_error, which names the file and the cause, if it or a row could not be
  // written.
  virtual void finish() = 0;
};

}  // namespace imud
