// truth_csv: truth as rows of text, which the truth format "csv" reads.
#pragma once

#include <string>

#include "core/truth.hpp"

namespace imud {

// The optional parts of a truth, as bits.
struct TruthParts {
  enum : unsigned {
    none = 0,
    position = 1,
    angular_acceleration = 2,
    specific_force = 4,
    accumulated_dv = 8,
    motion = 15,  // all of the above
    temperature = 16
  };
};
unsigned parts_of(const Truth& truth);

// Returns the header row, with its LF.
std::string truth_csv_header(unsigned parts = TruthParts::motion);

// Returns a row with these parts, with its LF. Requires that `truth` has these parts. Each double has the shortest
// text that is read back as the same double.
std::string truth_csv_row(const Truth& truth, unsigned parts = TruthParts::motion);

}  // namespace imud
