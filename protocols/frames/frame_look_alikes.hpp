// Refuses descriptions with messages that a decoder cannot tell apart.
#pragma once

#include <span>
#include <string_view>

#include "protocols/frames/frame_device.hpp"

namespace imud {

// Throws FrameFaults with each message that looks like an earlier message, if settings exist that let both be
// streamed. Two messages look alike if all frames of the later message fit the earlier one as well, so that the later
// message would never be decoded, or if the frames of one begin with whole frames of the other. If only some frames
// are ambiguous, FrameStreamDecoder decides by its order of messages. `file`: the file name for the faults. The
// compared frames are made from a few pseudo-random samples, which are the same in each call.
void refuse_look_alikes(std::span<const FrameMessage> messages, FrameEscape escape, std::string_view file);

}  // namespace imud
