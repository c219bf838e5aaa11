// The kinds of faults of the wire, which WirePort performs.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "emulator/plan/fault.hpp"
#include "protocols/protocol.hpp"

namespace imud {

enum class WireFault : std::uint8_t {
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
  count
};

// The table, in the order of WireFault, with the target "wire".
std::span<const FaultKind> wire_fault_kinds() noexcept;
// `kind` must be of wire_fault_kinds().
inline WireFault wire_fault(const FaultKind& kind) noexcept { return kind.code.as<WireFault>(); }

// Returns why a kind of the table cannot be on the line of a product with these settings, which are valid, and the
// remedy; empty if it can.
std::string wire_fault_objection(const FaultKind& kind, const Protocol& protocol, const Settings& settings);

}  // namespace imud
