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
    velocity = 2,
    angular_acceleration = 4,
    specific_force = 8,
    accumulated_dv = 16,
    motion = 31,  // all of the above
    temperature = 32,
    earth_angle = 64,
    magnetic_field = 128,
    pressure = 256,
    date = 512,
    stamp = 1024,  // is never written
    states = 2048  // the first of VehicleState; the others follow
  };
};
unsigned parts_of(const Truth& truth);
// Returns the parts of a first truth for which there are columns. The reader counts a date from the first row: it is
// written if the first truth has the time 0.
unsigned writable_parts_of(const Truth& first);
// Returns the names of these parts in words, separated by commas.
std::string names_of_parts(unsigned parts);

// Returns the header row, with its LF. The columns have Basilisk's names. If a part has no name there, all columns
// have the names of quantities of truth. With a date the time is GPS time, which its reader counts from the first
// row.
std::string truth_csv_header(unsigned parts = TruthParts::motion);

// Returns a row with these parts, with its LF. Requires that `truth` has these parts. Each double has the shortest
// text that is read back as the same double.
std::string truth_csv_row(const Truth& truth, unsigned parts = TruthParts::motion);

}  // namespace imud
