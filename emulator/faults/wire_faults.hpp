// The kinds of faults of the wire, which WirePort performs.
#pragma once

#include <cstddef>
#include <span>
#include <string>

#include "emulator/plan/fault.hpp"
#include "protocols/protocol.hpp"

namespace imud {

// The places of the kinds in their table.
enum class WireFault : std::size_t {
  bit_errors,
  byte_loss,
  byte_insertion,
  cut,
  checksum_wrong,
  content_wrong,
  garbage,
  line_break,
  silence,
  baud_wrong,
  disconnect,
  half_bandwidth,
  bus_off,
  error_frames,
  same_id,
  babbling,
  bus_load,
};

// The table, with the target "wire".
std::span<const FaultKind> wire_fault_kinds() noexcept;
// `kind` is one of the table.
inline WireFault wire_fault(const FaultKind& kind) noexcept {
  return static_cast<WireFault>(&kind - wire_fault_kinds().data());
}

// Returns why a kind of the table cannot be on the line of a product, and the remedy; empty if it can.
std::string wire_fault_objection(const FaultKind& kind, const Protocol& protocol);

}  // namespace imud
