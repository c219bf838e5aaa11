// Requirement: a limit that a figure of a run must keep, such as "imu1.samples>=1000" or "truth.refused<=1%".
#pragma once

#include <cstdint>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace imud {

struct Requirement {
  enum class Relation : std::uint8_t { at_least, at_most, equal, more, less };

  std::string text;    // as it was given
  std::string figure;  // its name, "imu1.samples"; who evaluates the requirement knows the names
  Relation relation = Relation::equal;
  double limit = 0;      // in the figure's unit, or percent
  bool percent = false;  // of the whole that belongs to the figure

  // Returns true if `value` keeps the limit. For a limit in percent `whole` is 100 %; if it is 0, every value counts
  // as 0 %.
  bool holds(double value, double whole) const noexcept;
};

// Thrown for a requirement that cannot be read, or that names a figure that does not exist. The text says how to mend
// the requirement.
struct RequirementError : std::invalid_argument {
  using std::invalid_argument::invalid_argument;
};

// Reads "FIGURE>=NUMBER", or with <=, =, ==, > or <, or with a % after the number; several are separated by commas.
// Throws RequirementError.
std::vector<Requirement> parse_requirements(std::string_view text);

}  // namespace imud
