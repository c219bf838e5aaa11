// divide_by_type: messages of one length that share a header, and that a byte tells apart.
//
// A type is a byte near the beginning that takes a few values. Bits of a status and high bytes of numbers do so, too,
// but a type changes from frame to frame, in nearly the same order each time; and in a counter of few values, which
// does that, too, it makes no difference for the other bytes which value it has.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "tools/find/frame_split.hpp"

namespace imud {

// Returns the frames of each type, by the first frame of each; all frames in one if there are no types. `length`:
// bytes of each frame. `is_taken`: of each byte, whether it belongs to a check. No more than 16 types.
std::vector<std::vector<FrameSplit::Place>> divide_by_type(std::span<const FrameSplit::Place> frames,
                                                           std::size_t length, const std::vector<bool>& is_taken,
                                                           std::span<const std::byte> stream);

}  // namespace imud
