// The names of the aids of a navigation filter, for people.
#pragma once

#include <array>
#include <string_view>

#include "core/sample.hpp"

namespace imud::aid {

// The names of the bits of namespace aid, from bit 0.
inline constexpr std::array<std::string_view, 7> names = {
    "gnss_position", "gnss_velocity", "magnetic_heading", "antennas_heading", "pressure", "zero_velocity", "gravity"};
static_assert(1U << (names.size() - 1) == gravity);

}  // namespace imud::aid
