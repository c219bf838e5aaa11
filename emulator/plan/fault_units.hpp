// The units in which the numbers of a fault may be given.
#pragma once

#include <span>
#include <string_view>

#include "protocols/quantities/key_units.hpp"

namespace imud {

// Returns the units of a target's values, without offsets; the first is the SI unit. Empty: the values have none.
std::span<const KeyUnit> fault_units(std::string_view target) noexcept;

}  // namespace imud
