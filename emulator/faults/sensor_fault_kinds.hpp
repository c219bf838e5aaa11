// The kinds of faults of the sensors.
#pragma once

#include <cstdint>

#include "emulator/plan/fault.hpp"

namespace imud {

// In the order of the table. The targets of the kinds before no_fix are sensors; the others' target is GNSS.
enum class SensorFault : std::uint8_t {
  bias,
  drift,
  scale,
  more_noise,
  stuck,
  stuck_at,
  dead,
  inverted,
  swapped,
  spike,
  saturation,
  quantisation,
  vibration,
  no_fix,
  position_jump,
  position_drift,
  gps_time_jump,
  satellites,
  accuracy,
  count
};

// `kind` must be of sensor_fault_kinds().
inline SensorFault sensor_fault_of(const FaultKind& kind) noexcept { return kind.code.as<SensorFault>(); }

}  // namespace imud
