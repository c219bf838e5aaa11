// Differences between the runs of a rack that work against one another.
#pragma once

#include "emulator/control/json_rpc.hpp"

namespace imud {

// Returns a text for each difference between the hosts: versions, epochs, the offset of TAI, and the instants at
// which the samples began; and a text for each clock that is not synchronised, or was set. `hosts`: the member
// `hosts` of rack_status().
Json differences(const Json& hosts);

}  // namespace imud
