// describe_frames: writes the findings as the beginning of a description (protocols/frames/README.md).
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "protocols/frames/layout/frame_description.hpp"
#include "tools/find/frame_finder.hpp"

namespace imud {

struct DescriptionText {
  std::string source;                      // of the capture, for people
  double rate_hz = 0;                      // of the messages that are sent most often; 0: not known
  std::vector<std::string> remarks = {};   // lines for people
  FrameEscape escape = FrameEscape::none;  // the escape that was removed from the stream
};

// Returns the description, with a test frame for each message. Bytes whose meaning is not known are `_:N`.
// Comments state the evidence, and everything that is not decided.
std::string describe_frames(const FoundFrames& found, std::span<const std::byte> stream, const DescriptionText& text);

}  // namespace imud
