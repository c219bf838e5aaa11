// The faults that clients began in a recorded run.
#pragma once

#include <vector>

#include "emulator/plan/config.hpp"

namespace imud {

// Returns the faults that commands begin when the record at `truth.port` is repeated. The configuration lacks these
// faults. Throws PortError if the file cannot be read.
std::vector<FaultConfig> begun_faults(const Config& config);

}  // namespace imud
