// The messages of a GNSS receiver on the node: uavcan.equipment.gnss.Fix2 and Auxiliary. As their reader,
// ArduPilot's AP_GPS_DroneCAN.cpp, needs them: the time as UTC, six variances. The receiver reports the place of the
// sample, and the height above the ellipsoid in place of the one above mean sea level.
#pragma once

#include <cstdint>

#include "core/sample.hpp"
#include "protocols/dronecan/messages.hpp"
#include "protocols/protocol.hpp"

namespace imud::dronecan {

// Where the place is not known, there is no fix: no time, no satellites, infinite variances are left out as 0, and
// the dilutions of precision are not a number. `time_us`: the timestamp, 56 bits. `figures`: where 0, the variances
// are as for a receiver under an open sky.
PackedPayload<gnss_fix2_size> fix2_of(const Navigation& navigation, const OwnFigures& figures,
                                      std::uint64_t time_us) noexcept;
PackedPayload<gnss_auxiliary_size> auxiliary_of(const Navigation& navigation) noexcept;

}  // namespace imud::dronecan
