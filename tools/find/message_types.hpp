// divide_by_type: separates messages that have the same length and header, and differ in a byte, their type.
//
// A type is a byte near the beginning that takes a few values. Bits of a status and high bytes of numbers take few
// values, too, but only a type changes from frame to frame in nearly the same order each time. A counter of few
// values also changes in this way, but the other bytes of a frame do not depend on the counter's value.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "tools/find/frame_split.hpp"

namespace imud {

// Returns the frames of each type, at most 16 types, in the order of their first frames. Returns all frames as one
// type if no types are found. `length` is the size of each frame in bytes. `is_taken` has a flag for each byte of a
// frame: true if the byte belongs to a check.
std::vector<std::vector<FrameSplit::Place>> divide_by_type(std::span<const FrameSplit::Place> frames,
                                                           std::size_t length, const std::vector<bool>& is_taken,
                                                           std::span<const std::byte> stream);

}  // namespace imud
