// The kind of a capture, before frames are sought in it: lines of text, frames with escaped bytes, or neither.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "protocols/frames/layout/frame_description.hpp"

namespace imud {

// Returns the escape by which the capture divides into frames of few lengths; nullopt if there is none, or if no byte
// of a frame had to be escaped, and the marks are constants like others. Looks at the first 256 KiB.
std::optional<FrameEscape> find_escape(std::span<const std::byte> capture);
// Returns the contents of all frames, one after another.
std::vector<std::byte> without_escape(std::span<const std::byte> capture, FrameEscape escape);

// Returns the beginning of a description of lines of text, in comments; empty if the capture has other bytes, or
// fewer than 8 lines. `source` is the name of the capture in the comments.
std::string describe_lines(std::span<const std::byte> capture, const std::string& source);

}  // namespace imud
