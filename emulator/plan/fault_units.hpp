// The units in which the numbers of a fault may be given.
#pragma once

#include <span>
#include <string_view>

#include "protocols/quantities/key_units.hpp"

namespace imud {

// Returns the units in which a fault of `target` may give its values; the first is the SI unit, or the degree
// Celsius. No unit has an offset (KeyUnit). Empty if the values have no unit.
std::span<const KeyUnit> fault_units(std::string_view target) noexcept;

}  // namespace imud
