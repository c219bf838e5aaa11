// Faults by control: the methods fault.begin, fault.end and fault.clear, and the faults as clients see them.
#pragma once

#include <span>
#include <string>

#include "emulator/control/change.hpp"
#include "emulator/faults/fault_book.hpp"

namespace imud {

// Returns the change that a method makes; fault.begin adds its fault to the book. Throws RpcError.
Change fault_change_of(const std::string& method, const Json& params, const Config& config, FaultBook& faults);

// The kinds that can be begun, with their targets and parameters. `units` of a parameter: the SI unit by target,
// spelt as in keys, where the key does not name it.
Json fault_kinds_json();
// The faults that act, by imu.
Json active_faults_json(const FaultBook& faults, const Config& config);
// The notification of a begin or an end. `imus`: their names.
Json fault_event_json(const FaultBook& faults, const FaultEvent& event, std::span<const std::string> imus);

}  // namespace imud
