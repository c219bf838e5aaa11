// Dwells: the times of a recording in which a table or a fixture stood still or turned steadily, and what was true
// then.
#pragma once

#include <iosfwd>
#include <optional>
#include <string>
#include <vector>

#include "core/vector.hpp"

namespace imud {

struct Dwell {
  double begin_s = 0, end_s = 0;  // after the first sample of the recording
  std::optional<Vector3> rate;    // rad/s, in the axes of the fixture, with the Earth's rate; nullopt: not known
  std::optional<Vector3> force;   // m/s^2, the specific force in these axes: at rest it points up
  std::optional<double> temperature_c;
};

// Reads a table of comma-separated values with the columns begin_s and end_s, and any of
//   rate_x_deg_per_s or rate_x_rad_per_s, and of y and z
//   force_x_g or force_x_m_per_s2, and of y and z
//   temperature_c
// in any order; an axis without a column, or with an empty field, is 0, and a quantity without any field is not
// known. Throws std::runtime_error, with `name`, the line, and what would be right.
std::vector<Dwell> read_dwells(std::istream& text, const std::string& name);

}  // namespace imud
