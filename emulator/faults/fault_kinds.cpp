#include "emulator/faults/fault_kinds.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <vector>

#include "emulator/faults/wire_faults.hpp"
#include "emulator/plan/inclinometers.hpp"

namespace imud {

std::span<const FaultKind* const> fault_kinds() noexcept {
  static const std::vector<const FaultKind*> all = [] {
    std::vector<const FaultKind*> kinds;
    for (const std::span<const FaultKind> table :
         {sensor_fault_kinds(), message_fault_kinds(), wire_fault_kinds(), power_fault_kinds(), truth_fault_kinds()})
      for (const FaultKind& kind : table) kinds.push_back(&kind);
    return kinds;
  }();
  return all;
}

const FaultKind* find_fault_kind(std::string_view name, std::string_view target) noexcept {
  if (name == "dropout") name = "missing";
  if (name == "delay") name = "late";
  for (const FaultKind* kind : fault_kinds())
    if (kind->name == name && std::ranges::find(kind->targets, target) != kind->targets.end()) return kind;
  return nullptr;
}

std::string fault_objection(const FaultKind& kind, std::string_view target, const Protocol& protocol,
                            const Settings& settings) {
  if (target == "inclinometer") return inclinometer_objection(protocol, settings);
  if (kind.seam == FaultSeam::wire) return wire_fault_objection(kind, protocol, settings);
  if (!kind.needs_self_test || protocol.has_self_test) return {};
  std::string right;
  for (const Protocol* other : protocols())
    if (other->has_self_test) right += fmt::format("{}{}", right.empty() ? "" : ", ", other->name);
  return fmt::format("{} reports no self test; these do: {}", protocol.name, right);
}

}  // namespace imud
