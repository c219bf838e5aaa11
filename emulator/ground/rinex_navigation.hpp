// Reads the orbits of GPS in a navigation file of the RINEX format.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "core/gnss/almanac.hpp"

namespace imud {

// Returns whether the text begins with a line of RINEX.
bool is_rinex(std::string_view text);

// Returns the orbits in the text of a RINEX navigation file of version 2 or 3: the broadcast ephemerides of GPS, a
// satellite's one after the other, unhealthy ones too if one of the satellite is healthy. The records of other
// systems are passed over. The columns are as RTKLIB 71db0ff reads them (src/rinex.c), the ranges of numbers are
// chosen. Throws std::runtime_error with the line's number and the remedy if the text is none, or has no healthy
// satellite.
std::vector<AlmanacOrbit> rinex_navigation(const std::string& text);

}  // namespace imud
