// Faults by control: the methods fault.begin, fault.repeat, fault.end and fault.clear, and the faults as clients see
// them.
#pragma once

#include <span>
#include <string>

#include "emulator/control/change.hpp"

namespace imud {

// Return the change that fault.begin, fault.repeat, fault.end and fault.clear make; the change of the first two has
// their fault. Throw RpcError.
Change begin_fault_change(const Json& params, const ChangeContext& context);
Change repeat_fault_change(const Json& params, const ChangeContext& context);
Change end_fault_change(const Json& params, const ChangeContext& context);
Change clear_faults_change(const Json& params, const ChangeContext& context);

// Returns the kinds of faults that can be begun, with their targets and parameters. `units` of a parameter is its
// SI unit for each target, spelt as in keys; empty if the parameter's key names the unit.
Json fault_kinds_json();
// Returns the faults of the configuration: name, and words for people.
Json configured_faults_json(const FaultBook& faults);
// Returns the faults that act, by imu.
Json active_faults_json(const FaultBook& faults, const Config& config);
// Returns the notification of the begin or the end of a fault. `imus`: the names of the imus.
Json fault_event_json(const FaultBook& faults, const FaultEvent& event, std::span<const std::string> imus);

}  // namespace imud
