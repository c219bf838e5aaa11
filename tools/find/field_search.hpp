// find_fields: finds specific forces, angular rates and their increments in two captures: one at rest, and one of
// the sensor turned by hand.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "tools/find/frame_finder.hpp"
#include "tools/find/handled_frames.hpp"

namespace imud {

// Adds fields and notes to the messages. The first `turned_bytes` of the stream are the capture of the sensor
// turned by hand, all other bytes are the capture at rest. `rate_hz` is the rate of the most frequent messages; 0 if
// it is not known. Returns remarks about all messages, a line each; some say what these captures do not show.
std::vector<std::string> find_fields(FoundFrames& found, std::span<const std::byte> stream, std::size_t turned_bytes,
                                     double rate_hz);

// Adds notes about the bytes of a message that are no field: numbers that hardly change, numbers that move, bits.
void note_other_numbers(FoundMessage& message, std::size_t index, const HandledFrames& frames,
                        std::vector<bool> is_free);

}  // namespace imud
