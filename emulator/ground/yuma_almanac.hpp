// Reads an almanac of GPS in the YUMA format.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/gnss/almanac.hpp"

namespace imud {

// Returns the orbits of the healthy satellites in the text of a YUMA file: 13 lines "key: value" for each satellite,
// of which the begin of the key counts, in any case and order from "ID" on (the U.S. Coast Guard Navigation Center's
// format, which has no specification; the keys are as Orekit 006b234 reads them, YUMAParser.java). A week number of
// less than 1024 is the one modulo 1024 that is nearest to `near_gps_ns`, ns since 1980-01-06. Throws
// std::runtime_error with the line's number and the remedy if the text is none.
std::vector<AlmanacOrbit> yuma_almanac(const std::string& text, std::int64_t near_gps_ns);

}  // namespace imud
