// The decoder of the throw-away IMU.
#pragma once

#include <memory>

#include "protocols/protocol.hpp"

namespace imud::throwaway_imu {

std::unique_ptr<Decoder> make_decoder(const Settings& settings);

}  // namespace imud::throwaway_imu
