// Which products have inclinometers.
#pragma once

#include <string>

#include "protocols/protocol.hpp"

namespace imud {

// Returns why an imu of this protocol cannot have errors or faults of inclinometers, and which protocols can; empty
// if the product with these settings has inclinometers.
std::string inclinometer_objection(const Protocol& protocol, const Settings& settings);

}  // namespace imud
