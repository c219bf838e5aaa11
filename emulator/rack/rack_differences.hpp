// Differences between the runs of a rack that work against one another.
#pragma once

#include "emulator/control/json_rpc.hpp"

namespace imud {

// Returns a text for each difference of the hosts in `hosts`, as rack_status() has them: of versions, of the offset
// of TAI, and of the instants at which the samples began; and for each clock that is not synchronised, or was set.
Json differences(const Json& hosts);

}  // namespace imud
