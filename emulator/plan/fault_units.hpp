// The units in which the numbers of a fault may be given.
#pragma once

#include <span>
#include <string_view>

namespace imud {

// A unit as a key ends, and its value in SI.
struct FaultUnit {
  std::string_view suffix;
  double si;
};
// Returns the units of a target's values; the first is that of SI. Empty: the values have none.
std::span<const FaultUnit> fault_units(std::string_view target) noexcept;

}  // namespace imud
