// Faults by control: the methods fault.begin, fault.repeat, fault.end and fault.clear, and the faults as clients see
// them.
#pragma once

#include <span>
#include <string>

#include "emulator/control/change.hpp"

namespace imud {

// Return the change that fault.begin, fault.repeat, fault.end and fault.clear make; the first two add their fault to
// the book. Throw RpcError.
Change begin_fault_change(const Json& params, const ChangeContext& context);
Change repeat_fault_change(const Json& params, const ChangeContext& context);
Change end_fault_change(const Json& params, const ChangeContext& context);
Change clear_faults_change(const Json& params, const ChangeContext& context);

// The kinds that can be begun, with their targets and parameters. `units` of a parameter: the SI unit by target,
// spelt as in keys, where the key does not name it.
Json fault_kinds_json();
// The faults of the configuration: name, and words for people.
Json configured_faults_json(const FaultBook& faults);
// The faults that act, by imu.
Json active_faults_json(const FaultBook& faults, const Config& config);
// The notification of a begin or an end. `imus`: their names.
Json fault_event_json(const FaultBook& faults, const FaultEvent& event, std::span<const std::string> imus);

}  // namespace imud
