// The kinds of faults of all seams.
#pragma once

#include <span>
#include <string>
#include <string_view>

#include "emulator/plan/fault.hpp"
#include "protocols/protocol.hpp"

namespace imud {

// The tables of the seams.
std::span<const FaultKind> sensor_fault_kinds() noexcept;
std::span<const FaultKind> message_fault_kinds() noexcept;
std::span<const FaultKind> truth_fault_kinds() noexcept;
std::span<const FaultKind> wire_fault_kinds() noexcept;
std::span<const FaultKind> power_fault_kinds() noexcept;

// Returns the kinds of all seams, by seam.
std::span<const FaultKind* const> fault_kinds() noexcept;
// Returns the kind of that name that has the target; nullptr if there is none. `missing` and `late` have a second
// name each, `dropout` and `delay`.
const FaultKind* find_fault_kind(std::string_view name, std::string_view target) noexcept;

// Returns why the product cannot have a fault of this kind on this target, and which it can have; empty if it can.
std::string fault_objection(const FaultKind& kind, std::string_view target, const Protocol& protocol,
                            const Settings& settings);

}  // namespace imud
