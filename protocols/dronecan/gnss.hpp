// The messages of a GNSS receiver on the node: uavcan.equipment.gnss.Fix2 and Auxiliary. The time is UTC, and there
// are six variances, as their reader needs them: ArduPilot's AP_GPS_DroneCAN.cpp. The receiver reports its last
// fix, with the time of the fix ("GNSS timestamp"). The height above the ellipsoid stands also for the height above
// mean sea level.
#pragma once

#include <cstdint>

#include "core/sample.hpp"
#include "protocols/dronecan/messages.hpp"
#include "protocols/protocol.hpp"

namespace imud::dronecan {

// Return the payloads. If the place is not known, there is no fix: no time, no satellites, variances of 0 (unknown),
// and dilutions of precision that are NaN. `time_us`: the timestamp of the message, 56 bits. `figures`: the standard
// deviations; if 0, a receiver under an open sky has the variances (receiver_accuracy.hpp).
PackedPayload<gnss_fix2_size> fix2_of(const Sample& sample, const OwnFigures& figures,
                                      std::uint64_t time_us) noexcept;
PackedPayload<gnss_auxiliary_size> auxiliary_of(const Navigation& navigation) noexcept;

}  // namespace imud::dronecan
