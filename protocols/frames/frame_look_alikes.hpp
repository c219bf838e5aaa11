// Refuses descriptions with messages that a decoder cannot tell apart.
#pragma once

#include <span>
#include <string_view>

#include "protocols/frames/frame_device.hpp"

namespace imud {

// Throws FrameFaults with each message that has a double: all its frames fit an earlier message as well, so that
// it would never be decoded, or the frames of one of the two begin with whole frames of the other; and the same
// settings let both be streamed. If only some frames are ambiguous, FrameStreamDecoder decides by its order of
// messages. `file`: the file name for the faults. The compared frames are made from a few pseudo-random samples,
// which are the same in each call.
void refuse_look_alikes(std::span<const FrameMessage> messages, FrameEscape escape, std::string_view file);

}  // namespace imud
