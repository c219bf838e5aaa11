// find_header_checks: checks of the header alone, beside the check of the frame.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "tools/find/frame_finder.hpp"

namespace imud {

// Returns the checks of 8 or 16 bits that stand in the first 16 bytes of the frames, of bytes before them or
// behind them in these 16 bytes. The returned checks agree in nearly all frames, and do not overlap the known
// checks of the message.
std::vector<FoundCheck> find_header_checks(const FoundMessage& message, std::span<const std::byte> stream);

}  // namespace imud
