// An error frame of a CAN bus, as the driver of a controller reports it.
#pragma once

#include <linux/can/error.h>

#include <array>
#include <cstddef>

#include "core/frame.hpp"

namespace imud {

// A violation of bit stuffing. The data begin with the bit at which arbitration was lost, the controller's state, and
// the kind of the violation (linux/can/error.h).
inline constexpr CanHeader bus_error_header = {.id = CAN_ERR_PROT | CAN_ERR_BUSERROR, .error = true};
inline constexpr std::array<std::byte, CAN_ERR_DLC> bus_error_data = {std::byte{}, std::byte{},
                                                                      std::byte{CAN_ERR_PROT_STUFF}};

}  // namespace imud
