// Reads the descriptions of frames (protocols/frames/README.md) from TOML, for protocols, which read none.
#pragma once

#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "protocols/frames/layout/frame_description.hpp"
#include "protocols/settings.hpp"

namespace imud {

// A description that CMake builds in, from protocols/frames.
struct ShippedFrames {
  std::string_view name;  // the stem of its file
  std::string_view text;
};
// Returns all of them, sorted by name.
std::span<const ShippedFrames> shipped_frames() noexcept;

// Reads the file, if `name` contains a slash or ends with .toml, or else the shipped description of that name. The
// returned description is valid: every message can be compiled, and each test frame has its values. Throws
// ConfigError with every fault.
std::shared_ptr<const FrameDescription> read_frames(const std::string& name);
// Reads the description from the text of a file. `file` is the name for messages.
std::shared_ptr<const FrameDescription> frames_of_text(std::string_view text, const std::string& file);

// Reads the description that a setting names (Setting::names_frames), and attaches it to `settings`; does nothing
// if no setting names a description. Throws ConfigError; then the setting has its initial value.
void attach_frames(Settings& settings, std::span<const Setting> declared);

}  // namespace imud
